"""The way in on a machine made of arithmetic: a clock, a kernel's buffer, and work that takes its time."""

import asyncio
import socket
import struct
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Sequence
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gestured.core.owner import Source
from gestured.daemon import udp
from gestured.daemon.health import TICK_S
from gestured.daemon.mute import Rule
from gestured.daemon.udp import TIMESTAMP, Receiver

STOP_S = 1.3
LOOP_S = 0.005  # between two reads
READ_S = 3e-6  # what it takes to read a packet
BUFFER_BYTES = 208 << 10  # what the kernel grants whoever may not ask for more

Sent = tuple[float, bytes, Source]  # s, a packet, and who sends it


class Machine:
    """A processor and the UDP socket that it reads; `cost` says how many seconds a packet takes to serve.

    It stands still for STOP_S at those of the looks at its clock that `stops` counts off.
    """

    def __init__(self, sent: Iterable[Sent], cost: Callable[[bytes], float], stops: Collection[int] = ()) -> None:
        self.now = self.worked_s = 0.0
        self.admitted: list[float] = []  # s, when packets came for which there was room
        self.served: list[tuple[bytes, Source]] = []
        self.owners: set[Source] = set()  # those who were served before the last tick
        self.due = float("inf")
        self._sent, self._cost = deque(sorted(sent)), cost
        self._buffer: deque[Sent] = deque()
        self._size = self._dropped = self._looks = 0
        self._stops = stops
        self._rules: list[Rule] = []
        self._pair = socket.socketpair()
        self.fileno = self._pair[0].fileno

    def work(self, seconds: float) -> None:
        """The processor does something for so long."""
        self.worked_s += seconds
        self.wait(seconds)

    def wait(self, seconds: float) -> None:
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
                self.admitted.append(one[0])
                self._size += len(one[1])

    def rest(self) -> None:
        """The loop does something else, for long where all was served."""
        self.wait(1e-4 if len(self.served) < len(self.admitted) else LOOP_S)

    def clock(self) -> float:
        self._looks += 1
        if self._looks in self._stops:
            self.wait(STOP_S)
        return self.now

    # --- the socket

    def recvmsg(self, *_: int) -> tuple[bytes, list[Any], int, Source]:
        self.work(READ_S)
        if not self._buffer:
            raise BlockingIOError
        t, packet, source = self._buffer.popleft()
        self._size -= len(packet)
        return packet, [(0, 0, TIMESTAMP.pack(int(t), round(t % 1 * 1e9)))], 0, source

    def getsockopt(self, *_: int) -> bytes:
        return struct.pack("@9I", *[0] * 8, self._dropped)

    def mute(self, rules: Iterable[Rule]) -> None:
        self._rules = list(rules)

    # --- the hub, its desk and the taps

    active = False

    def receive(self, packets: Sequence[tuple[bytes, Source]], now: float) -> list[Any]:
        for packet, _ in packets:
            self.work(self._cost(packet))
        self.served += packets
        return []

    def missed(self) -> None: ...

    def take(self, facts: list[Any]) -> None: ...

    def drop(self, *_: Any, **__: Any) -> None: ...

    def muted(self, senders: Any) -> None: ...


def run(machine: Machine, seconds: float, look: Callable[[Receiver], None] = lambda receiver: None) -> None:
    """Read for so long, as the daemon's loop does, and look at the receiver after each read."""

    async def main() -> None:
        receiver = Receiver(machine, 0.0, machine, machine, machine, machine.clock)  # type: ignore[arg-type]
        tick = 0.0
        while machine.now < seconds:
            if machine.now >= tick:
                tick = machine.now + TICK_S
                machine.owners = {source for _, source in machine.served}
            receiver.read()
            look(receiver)
            machine.rest()
        receiver.close()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(udp, "time", SimpleNamespace(time=machine.clock, thread_time=lambda: machine.worked_s))
        patch.setattr(udp, "mute", Machine.mute)
        asyncio.run(main())


def sensors(count: int, frames: int) -> list[Sent]:
    """Frames of so many sensors at 15 Hz; a frame is its number."""
    return [(0.01 + n / 15 + k / 100, b"%d" % n, ("10.0.0.1", k)) for n in range(frames) for k in range(count)]


@settings(max_examples=50, deadline=None)
@given(st.sets(st.integers(0, 6000), max_size=4), st.sampled_from([3e-6, 2e-4]))
def test_all_that_arrived_until_then_was_served_wherever_it_stands_still(stops: set[int], cost_s: float) -> None:
    """A stranger's rubbish lies before the frames, more than a read takes, and a stop may begin at any moment."""
    rubbish = [(t + n * 1e-6, b"x" * 100, ("10.0.0.9", 1)) for t in (0.5, 1.5, 2.5) for n in range(1000)]
    machine = Machine([*sensors(4, 60), *rubbish], lambda packet: cost_s, stops)

    def look(receiver: Receiver) -> None:
        machine.clock()  # where it may stand still, too
        waiting = machine.admitted[len(machine.served) :]  # packets are served in the order in which they came
        assert receiver.served <= min(waiting, default=machine.now) + 1e-6  # s; the kernel counts nanoseconds
        assert waiting or receiver.served > machine.now - STOP_S * (len(stops) + 1)

    run(machine, 8.0, look)
    assert len(machine.served) == len(machine.admitted)


@pytest.mark.parametrize("ports", [1, 20, 58])
@pytest.mark.parametrize(("cost_s", "burst"), [(0.002, 1), (0.012, 1), (0.012, 50)])
def test_while_owners_send_full_packets_nobody_else_loses_one(ports: int, cost_s: float, burst: int) -> None:
    """They come one at a time, so that a read finds few, or many at once; each costs as much as several turns."""
    good = sensors(4, 145)
    full = [(n // burst * burst / 600, bytes(55_000), ("10.0.0.9", n % ports)) for n in range(600 * 10)]
    machine = Machine([*good, *full], lambda packet: cost_s if len(packet) > 1000 else 1e-4)
    run(machine, 10.0)
    heard = Counter(int(packet) for packet, (host, _) in machine.served if host == "10.0.0.1")
    assert all(heard[n] == 4 for n in range(30, 145))  # by then it was seen to be a flood
    assert sum(heard.values()) >= 0.97 * len(good)
