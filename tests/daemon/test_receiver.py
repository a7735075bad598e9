"""The way in on a machine made of arithmetic: a clock, a kernel's buffer, and work that takes its time."""

import math
import struct
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Sequence
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gestured.core.owner import Source
from gestured.daemon import udp
from gestured.daemon.backlog import TOGETHER_S
from gestured.daemon.health import TICK_S
from gestured.daemon.mute import Rule
from gestured.daemon.udp import PAUSE_S, TIMESTAMP, Receiver

START_S = 1000.0
STOP_S = 1.3
TURN_S = 1e-5  # of the loop, besides what is done in it
READ_S = 3e-6  # what it takes to read a packet
RUBBISH = b"x"  # with which packets begin whose senders own no sensor
BUFFER_BYTES = 208 << 10  # what the kernel grants whoever may not ask for more

Sent = tuple[float, bytes, Source]  # s, a packet, and who sends it


class Timer:
    """What a loop is to do, and when."""

    def __init__(self, when: float, act: Callable[[], None]) -> None:
        self.when, self.act = when, act
        self.cancelled = False

    def cancel(self) -> None:
        self.cancelled = True


class Machine:
    """A processor, its loop and the UDP socket that it reads; `cost` says how many seconds a packet takes to serve.

    It stands still for STOP_S at those of the looks at its clock that `stops` counts off.
    """

    def __init__(self, sent: Iterable[Sent], cost: Callable[[bytes], float], stops: Collection[int] = ()) -> None:
        self.now, self.worked_s = START_S, 0.0
        # s, when packets came for which there was room and which were not served yet, by packet and source
        self.waiting: dict[tuple[bytes, Source], deque[float]] = {}
        self.admitted = 0  # packets for which there was room
        self.served: list[tuple[bytes, Source]] = []
        self.owners: dict[Source, int] = {}  # sensors of those who were served before the last tick
        self.each = 1  # sensors that a source owns
        self.due, self.due_s = (
            float("inf"),
            float("inf"),
        )  # s, when time alone decides, and how long after a packet that is
        self.waits_s: list[float] = []  # how long after `due` each decision came
        self._sent, self._cost = deque((START_S + t, packet, source) for t, packet, source in sorted(sent)), cost
        self._buffer: deque[Sent] = deque()
        self._size = self._dropped = self._looks = 0
        self._stops = stops
        self._rules: list[Rule] = []
        self._timers: list[Timer] = []
        self._looked = self.now  # s, when the loop last looked at its clock
        self._reader: Callable[[], None] | None = None
        self.looks, self.look_s, self.looked_s = False, 0.0, 0.0  # at contacts, for provisional events
        self.asks = self.shown = 0  # segments that wait for their names, which cost as much, and that a packet shows
        self.latest_s = 0.0  # that a packet was served after it came
        self.received = 0  # times that packets were handed on
        self.moved_s = 0.0  # by which the time that a packet was given differed from when it came

    def work(self, seconds: float) -> None:
        """The processor does something for so long."""
        self.worked_s += seconds
        self.passes(seconds)

    def passes(self, seconds: float) -> None:
        """Time passes, and packets arrive."""
        self.now += seconds
        while self._sent and self._sent[0][0] <= self.now:
            one = self._sent.popleft()
            host, port = one[2]
            if not next((rule.let_in for rule in self._rules if host == rule.host and rule.port in (None, port)), True):
                continue
            if self._size > BUFFER_BYTES:
                self._dropped += 1
            else:
                self._buffer.append(one)
                self.admitted += 1
                self.waiting.setdefault(one[1:], deque()).append(one[0])
                self._size += len(one[1])

    def clock(self) -> float:
        self._looks += 1
        if self._looks in self._stops:
            self.passes(STOP_S)
        return self.now

    # --- the loop

    def add_reader(self, _: object, act: Callable[[], None]) -> None:
        self._reader = act

    def remove_reader(self, _: object) -> None:
        self._reader = None

    def call_later(self, seconds: float, act: Callable[[], None]) -> Timer:
        self._looked = self.now
        self._timers.append(Timer(self.now + round(seconds, 3), act))  # a loop's timers know milliseconds alone
        return self._timers[-1]

    def call_soon(self, act: Callable[[], None]) -> Timer:
        return self.call_later(0.0, act)

    def turn(self) -> None:
        """Do what is due, then wait for what is next, for as long as was left when the loop last looked at its clock.

        That is when a turn began or a timer was set, as in libuv.
        """
        self._looked = self.now
        self._timers = [timer for timer in self._timers if not timer.cancelled]
        due = [timer for timer in self._timers if timer.when <= self.now]
        self._timers = [timer for timer in self._timers if timer.when > self.now]
        for timer in due:
            if not timer.cancelled:
                timer.act()
        if self._buffer and self._reader is not None:
            self._reader()
        else:
            timers = [self.now + timer.when - self._looked for timer in self._timers if not timer.cancelled]
            following = timers + [t for t, _, _ in list(self._sent)[:1]]
            self.passes(max(0.0, min(following, default=self.now) - self.now))
        self.passes(TURN_S)

    # --- the socket

    def recvmsg(self, *_: int) -> tuple[bytes, list[Any], int, Source]:
        self.work(READ_S)
        if not self._buffer:
            raise BlockingIOError
        t, packet, source = self._buffer.popleft()
        self._size -= len(packet)
        address: Any = (*source, 0, 0) if ":" in source[0] else source  # one of IPv6 has a flow and a scope, too
        return packet, [(0, 0, TIMESTAMP.pack(int(t), round(t % 1 * 1e9)))], 0, address

    def getsockopt(self, *_: int) -> bytes:
        return struct.pack("@9I", *[0] * 8, self._dropped)

    def mute(self, rules: Iterable[Rule]) -> None:
        self._rules = list(rules)

    # --- the hub, its desk and the taps

    active = False

    def receive(self, packets: Sequence[tuple[bytes, Source]], now: float) -> list[Any]:
        self.received += 1
        for packet, source in packets:
            times = self.waiting[packet, source]
            came = times.popleft()
            if not times:
                del self.waiting[packet, source]
            self.moved_s = max(self.moved_s, abs(now - came))
            self.latest_s = max(self.latest_s, self.now - came)
            self.work(self._cost(packet))
            self.served.append((packet, source))
            self.due = now + self.due_s
            self.asks += self.shown
        return []

    def ask(self, now: float) -> list[Any]:
        self.asks -= 1
        self.work(self.look_s)
        return []

    def wait(self, now: float) -> list[Any]:
        assert now <= min((times[0] for times in self.waiting.values()), default=now) + 1e-6, (
            "time decides beyond what was served"
        )
        if now >= self.due:
            self.waits_s.append(self.now - self.due)
            self.due = float("inf")
        return []

    def look(self, now: float) -> list[Any]:
        self.work(self.look_s)
        self.looked_s += self.look_s
        return []

    def missed(self) -> None: ...

    def take(self, facts: list[Any]) -> None: ...

    def drop(self, *_: Any, **__: Any) -> None: ...

    def muted(self, senders: Any) -> None: ...


def run(machine: Machine, seconds: float, look: Callable[[Receiver], None] = lambda receiver: None) -> None:
    """Let the daemon's loop turn for so long, and look at the receiver after each turn."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(udp, "time", SimpleNamespace(time=machine.clock, thread_time=lambda: machine.worked_s))
        patch.setattr(udp, "mute", Machine.mute)
        patch.setattr(udp, "asyncio", SimpleNamespace(get_running_loop=lambda: machine))
        receiver = Receiver(machine, START_S, machine, machine, machine, machine.clock)  # type: ignore[arg-type]

        def tick() -> None:
            machine.call_later(TICK_S, tick)
            receiver.read()
            machine.owners = {source: machine.each for packet, source in machine.served if packet[:1] != RUBBISH}

        tick()
        while machine.now < START_S + seconds:
            machine.turn()
            look(receiver)


def sensors(count: int, frames: int) -> list[Sent]:
    """Frames of so many sensors at 15 Hz; a frame is its number."""
    return [(0.01 + n / 15 + k / 100, b"%d" % n, ("10.0.0.1", k)) for n in range(frames) for k in range(count)]


@settings(max_examples=40, deadline=None)
@given(st.sets(st.integers(0, 1500), max_size=4), st.sampled_from([3e-6, 2e-4]))
@example({900}, 2e-4)  # what is due is decided by packets that are found then
def test_wherever_it_stands_still_all_that_arrived_is_served_and_no_frame_moves(stops: set[int], cost_s: float) -> None:
    """A stranger's rubbish lies before the frames, more than a read takes, and a stop may begin at any moment."""
    rubbish = [(t + n * 1e-6, RUBBISH * 100, ("10.0.0.9", 1)) for t in (0.5, 1.5) for n in range(400)]
    machine = Machine([*sensors(4, 40), *rubbish], lambda packet: cost_s, stops)
    machine.due_s = 0.1
    turns = 0

    def look(receiver: Receiver) -> None:
        nonlocal turns
        turns += 1
        assert turns < 5000, "the loop comes round without end though nothing is to be done"
        machine.clock()  # where it may stand still, too
        waiting = [times[0] for times in machine.waiting.values()]
        assert receiver.served <= min(waiting, default=machine.now) + 1e-6  # s; the kernel counts nanoseconds
        assert waiting or receiver.served > machine.now - STOP_S * (len(stops) + 1)

    run(machine, 7.0, look)
    assert len(machine.served) == machine.admitted
    assert machine.moved_s < TOGETHER_S  # packets that arrived together have one time


@pytest.mark.parametrize(("apart_s", "received", "latest_s"), [(1 / 15, 100, 0.0), (0.0004, 25, PAUSE_S)])
def test_packets_that_come_thick_are_taken_together_and_no_others_wait(
    apart_s: float, received: int, latest_s: float
) -> None:
    """They come in pairs, 0.2 ms from one to the other: two by themselves are not thick."""
    pairs = [(0.01 + n * apart_s + m * 2e-4, b"x", ("10.0.0.1", 1)) for n in range(50) for m in range(2)]
    machine = Machine(pairs, lambda packet: 1e-5)
    run(machine, 5.0)
    assert len(machine.served) == 100 and machine.received <= received and machine.latest_s < latest_s + 1e-4


@pytest.mark.parametrize("apart_s", [0.0, 0.0002, 0.001, 0.003])
def test_what_the_way_held_up_is_taken_at_once_and_others_do_not_wait_for_it(apart_s: float) -> None:
    """As Wi-Fi does: for 0.3 s nothing of one sensor passes, and then all of it, each packet a little after another."""
    good = sensors(2, 90)
    late: list[Sent] = []
    for n in range(90):
        t, turn = 0.015 + n / 15, 2.0 * (n // 30)
        behind = n - math.ceil((turn + 1.7 - 0.015) * 15)  # how many are held up before it
        passes = t if behind < 0 else turn + 2.0 + behind * apart_s
        late.append((passes, b"%d" % n, ("10.0.0.2", 1)))
    machine = Machine([*good, *late], lambda packet: 1e-4)
    taken: list[list[int]] = []
    receive = machine.receive

    def look(packets: Sequence[tuple[bytes, Source]], now: float) -> list[Any]:
        taken.append([int(packet) for packet, (host, _) in packets if host == "10.0.0.2"])
        assert all(host == "10.0.0.2" or machine.now - now < 1e-3 for _, (host, _) in packets)
        return receive(packets, now)

    machine.receive = look  # type: ignore[method-assign]
    run(machine, 7.0)
    assert [len(some) for some in taken if len(some) > 1] == [4] * 3 and sum(taken, []) == list(range(90))


@pytest.mark.parametrize("ports", [1, 58])
@pytest.mark.parametrize(("cost_s", "burst"), [(0.002, 1), (0.012, 1), (0.012, 50)])
def test_while_owners_send_full_packets_nobody_else_loses_one(ports: int, cost_s: float, burst: int) -> None:
    """They come one at a time, so that a read finds few, or many at once; each costs as much as several turns."""
    good = sensors(4, 145)
    full = [(n // burst * burst / 600, bytes(55_000), ("fd00::9", n % ports)) for n in range(600 * 10)]
    machine = Machine([*good, *full], lambda packet: cost_s if len(packet) > 1000 else 1e-4)
    run(machine, 10.0)
    heard = Counter(int(packet) for packet, (host, _) in machine.served if host == "10.0.0.1")
    assert sum(heard.values()) >= 0.97 * len(good)
    assert sum(heard[n] for n in range(30, 145)) >= 0.99 * 4 * 115  # by then it was seen to be a flood


@pytest.mark.parametrize(("ports", "rate", "cost_s"), [(130, 600, 0.012), (64, 64, 0.02)])
def test_owners_that_pause_before_each_full_packet_do_not_stop_the_loop(
    ports: int, rate: int, cost_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of these packets is a bunch, and a large buffer of the kernel holds many of them."""
    monkeypatch.setitem(globals(), "BUFFER_BYTES", 8 << 20)
    full = [(n / rate, bytes(55_000), ("10.0.0.9", n % ports)) for n in range(rate * 10)]
    machine = Machine([*sensors(4, 145), *full], lambda packet: cost_s if len(packet) > 1000 else 1e-4)
    turns = [machine.now]
    run(machine, 10.0, lambda receiver: turns.append(machine.now))
    assert max(later - before for before, later in pairwise(turns)) < 0.5  # s; systemd's watchdog allows two


def test_a_source_of_many_sensors_that_cannot_be_followed_is_heard_all_the_while() -> None:
    """Three hundred sensors behind one address come to more work than there is time, as while they are learned."""
    frames = [(0.01 + n / 15 + k / 4500, b"%3d" % k * 130, ("10.0.0.1", 1)) for n in range(120) for k in range(300)]
    machine = Machine(frames, lambda packet: 1e-3)
    machine.each = 300
    served: list[tuple[float, int]] = []
    run(machine, 8.0, lambda receiver: served.append((machine.now - START_S, len(machine.served))))
    by_second = [max(count for t, count in served if t <= second) for second in range(1, 9)]
    assert min(later - before for before, later in pairwise(by_second)) >= 0.3 / 1e-3


class Learns(Machine):
    """A machine on which a sensor's first frames are dear, and later ones cheap where several are served together."""

    def __init__(self, sent: Iterable[Sent]) -> None:
        super().__init__(sent, lambda packet: 6e-5)
        self.seen: Counter[bytes] = Counter()

    def receive(self, packets: Sequence[tuple[bytes, Source]], now: float) -> list[Any]:
        known = sum(self.seen[packet] >= 15 for packet, _ in packets)
        self.work(2.1e-3 * (len(packets) - known) + 1.5e-3 * (known > 0))
        self.seen.update(packet for packet, _ in packets)
        return super().receive(packets, now)


@pytest.mark.parametrize("ports", [1, 200])
def test_many_sensors_are_followed_again_once_they_are_known(ports: int) -> None:
    """Until then they come to six times the work that there is time for, and later to a third of it.

    One by one they would still come to five times of it.
    """
    frames = [
        (0.01 + n / 15 + k / 3000, b"%3d" % k * 130, ("10.0.0.1", k % ports)) for n in range(165) for k in range(200)
    ]
    machine = Learns(frames)
    machine.each = 200 // ports
    run(machine, 11.5)
    assert set(Counter(packet for packet, _ in machine.served[-2 * 3000 :]).values()) == {30}


def many(seconds: float, *, looks: bool = False, look_s: float = 0.0, asks: int = 0) -> Machine:
    """A machine that has served eighty sensors for so long, beside contacts to look at and segments to name."""
    machine = Machine(sensors(80, round(15 * (seconds - 1))), lambda packet: 2e-4)
    machine.looks, machine.look_s, machine.asks = looks, look_s, asks
    run(machine, seconds)
    assert len(machine.served) == machine.admitted
    return machine


@pytest.mark.parametrize("look_s", [0.0003, 0.012])
def test_provisional_events_take_a_third_of_the_time_and_no_packet_waits_for_two_of_them(look_s: float) -> None:
    """However many contacts there are to look at."""
    machine = many(4.0, looks=True, look_s=look_s)
    assert machine.latest_s < many(4.0).latest_s + 2 * look_s
    assert 0.1 * 4.0 < machine.looked_s < 4.0 / 3


def test_of_segments_that_are_shown_together_each_gets_its_name_and_no_packet_waits_for_two_of_them() -> None:
    machine = many(4.0, asks=40, look_s=0.001)
    assert machine.asks == 0
    assert machine.latest_s < many(4.0).latest_s + 2 * 0.001


@pytest.mark.parametrize("look_s", [0.0, 0.004])
@pytest.mark.parametrize(("apart_s", "most_s"), [(1 / 15, 0.0002), (0.008, 0.0022)])
def test_what_time_alone_decides_waits_neither_for_a_packet_nor_for_a_tick(
    apart_s: float, most_s: float, look_s: float
) -> None:
    """It is decided at that moment; beside packets that come often, with the next turn of a timer of milliseconds.

    That the model ran for `look_s` just before makes it no later.
    """
    for due_s in (0.0301, 0.1317):
        machine = Machine([(0.01 + n * apart_s, b"x", ("10.0.0.1", 1)) for n in range(5)], lambda packet: 1e-5)
        machine.due_s, machine.shown, machine.look_s = due_s, int(look_s > 0), look_s
        run(machine, 1.0)
        (late_s,) = machine.waits_s[-1:]
        assert 0.0 <= late_s < most_s
