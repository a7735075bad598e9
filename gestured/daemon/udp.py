"""The receiver of OSC over UDP: reads the packets that wait in a socket, and gives them to the hub with their arrivals.

It is used in place of asyncio's DatagramProtocol for two reasons. It asks the kernel when each packet came, so that a
stall of the loop, however long, changes no frame's time. And if packets come thick, as those of hundreds of sensors do,
it reads them together each millisecond, which costs less.

Work is done in slices, between which the loop serves everybody else.
"""

import asyncio
import math
import socket
import struct
import sys
import time
from collections.abc import Callable, Sequence
from itertools import chain

from gestured.core.hub import Hub
from gestured.core.owner import Source
from gestured.daemon.backlog import FLOOD_S, GROUP, GROUP_BYTES, TOGETHER_S, Backlog, Packet
from gestured.daemon.bunch import Bunches
from gestured.daemon.desk import Desk
from gestured.daemon.mute import LONGEST_S, Muted, Sender, mute
from gestured.daemon.sockets import kernel_drops
from gestured.daemon.tap import Taps

PACKET_BYTES = 65_536
SLICE_S = 0.005  # s of work on waiting packets before the loop serves everybody else
FLOOD_SLICE_S = 0.001, 0.01  # s of work on waiting packets in a flood, at least and at most; see `Receiver._slice`
TURN_S = 0.05  # s, the most work in one turn of a flood, in case packets cost more than their senders' earlier ones
DRAIN_S = 0.25  # s for serving packets that still wait when the daemon ends
PAUSE_S = 0.001  # between reads of packets that come thick, since waking for a packet is much of its cost
FULL_S = 0.25  # s for which a stall explains that the kernel drops packets; if it drops them for longer, it is a flood
EARLY_S = 0.001  # s by which the alarm is early (late if packets come often), since the loop's timers have whole ms
REST = 2  # seconds that the loop has for everything else, for each second that is spent on provisional events
SPARSE_S = 0.02  # between packets; if they are further apart, the alarm is early, and the end of a wait is met exactly
STEP_S = 0.05  # by which the wall clock may move against the monotonic one; after a larger step, stamps are not used

TIMESTAMP = struct.Struct("@ll")  # s and ns since the epoch, by the wall clock, in long integers of the machine
UNKNOWN = TIMESTAMP.pack(sys.maxsize, 0)  # the time of a packet for which the kernel has told none
ANCILLARY_BYTES = socket.CMSG_SPACE(TIMESTAMP.size)


class Receiver:
    """Reads a UDP socket until it is closed."""

    def __init__(
        self,
        sock: socket.socket,
        empty: float,
        hub: Hub,
        desk: Desk,
        taps: Taps,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Give `hub` the packets since the socket was `empty` (s), its facts to `desk`, and all packets to `taps`."""
        self._loop = asyncio.get_running_loop()
        self._sock, self._hub, self._desk, self._taps, self._clock = sock, hub, desk, taps, clock

        def owned(source: Source) -> int:
            return hub.owners.get(source, 0)  # looked up each time, since a tick of the hub makes a new table

        self._backlog, self._bunches = Backlog(owned), Bunches(owned)
        self._muted = Muted()
        _, self._wall = self._clocks()  # s, from the monotonic clock to the wall clock of the kernel's stamps
        self._empty = empty  # s: packets that arrived until then were read
        # s: packets that arrived until then were served. Nothing may be decided by a later time: a sensor is not silent
        # while its packets wait here, or in the socket behind those of others.
        self.served = empty
        self.behind_s = 0.0  # s by which the packets to be served were late at the last read, without bunches
        self._drops = 0  # the kernel's count of dropped packets at the last look
        self._dropping = -FLOOD_S  # s, when the kernel began to drop packets
        self._looked = 0.0  # s, when we last looked whether something waits
        self._shared = 0.0  # s, when we last shared out work in a flood
        self._sparse = False  # whether the last packets came SPARSE_S or more after others
        self._pause: asyncio.TimerHandle | None = None
        self._again: asyncio.Handle | None = None
        self._holding: asyncio.TimerHandle | None = None  # reads again when the next bunch is complete
        self._due = math.inf  # s, when time alone will decide something
        self._alarm: asyncio.Handle | None = None
        self._asking: asyncio.Handle | None = None
        self._foreseeing: asyncio.Handle | None = None
        self._loop.add_reader(sock, self._wake)

    def close(self) -> None:
        """Stop reading; the socket stays its owner's."""
        self._loop.remove_reader(self._sock)
        for handle in (self._pause, self._again, self._holding, self._alarm, self._asking, self._foreseeing):
            if handle is not None:
                handle.cancel()

    def _wake(self) -> None:
        now = self._clock()
        pause_s = now - self._looked
        thick, self._sparse, self._looked = pause_s < PAUSE_S, pause_s >= SPARSE_S, now
        self.read()
        if thick and not self._backlog.flooded(now):  # in a flood no read is put off
            self._loop.remove_reader(self._sock)
            self._pause = self._loop.call_later(PAUSE_S, self._listen)

    def _listen(self) -> None:
        self._looked = self._clock()
        self._loop.add_reader(self._sock, self._wake)

    def drain(self) -> None:
        """Serve all packets that wait, for at most DRAIN_S, before the daemon ends."""
        end = self._clock() + DRAIN_S
        self.read()
        while self._again is not None and self._clock() < end:
            self.read()
        self._release(math.inf)
        while self._backlog and self._clock() < end:
            self._work(self._clock())

    def read(self) -> None:
        """Read the packets that wait, and serve as many as fit into a slice of time; the others have a later turn."""
        if self._again is not None:
            self._again.cancel()
            self._again = None
        began = self._clock()
        found, stamps, full = self._receive()
        now, wall = self._clocks()
        if abs(wall - self._wall) > STEP_S:
            stamps = [UNKNOWN] * len(found)
        arrivals = self._arrivals(stamps, now)
        much = len(found) > 1 and sum([len(packet) for packet, _ in found]) > GROUP_BYTES
        late = bool(found) and now - arrivals[0] >= TOGETHER_S
        if found and (full or much or late or self._backlog or self._backlog.flooded(now)):
            self._put(found, arrivals, now)
            self._count_drops(now)
            if stamps[-1] is not UNKNOWN:
                self._empty = arrivals[-1]  # the kernel gives packets in the order in which they came
        elif found:
            self._take(found, arrivals, now)
        if not full:
            self._empty = began  # the packets of the next read came later, even if we were stopped since
        self._wall = wall
        if self._backlog:
            self._work(now)
        self._release(now)
        self._mute(now, self._muted.over(now))
        self.served = min(self._empty, self._backlog.oldest, self._bunches.oldest)
        self.behind_s = now - min(self._empty, self._backlog.oldest)
        if self._backlog or full:
            self._again = self._loop.call_soon(self.read)

    def _take(self, found: list[Packet], arrivals: list[float], now: float) -> None:
        """Serve few packets. Bunches that were complete before come with them, and may be more than a turn's work."""
        alone, came = self._bunches.pick(found, arrivals)
        if sum([len(packet) for packet, _ in alone]) > GROUP_BYTES:
            self._backlog.add(alone, came)
        elif alone:
            self._serve(alone, now)

    def _put(self, found: list[Packet], arrivals: list[float], now: float) -> None:
        """Put packets with these arrivals (s) into the backlog, but for those that are held back for their bunch."""
        if self._backlog.flooded(now):  # too much comes already to hold packets back
            for bunch in self._bunches.over(math.inf):
                self._backlog.add(bunch.packets, bunch.arrivals)
            self._backlog.add(found, arrivals)
        else:
            self._backlog.add(*self._bunches.pick(found, arrivals))

    def _release(self, now: float) -> None:
        """Serve the bunches that are complete, as far as they are one turn's work, and come back for the next one."""
        size = 0
        for bunch in self._bunches.over(now):
            size += sum([len(packet) for packet, _ in bunch.packets])
            if size <= GROUP_BYTES:
                self._serve(bunch.packets, bunch.arrivals[-1])
            else:
                self._backlog.add(bunch.packets, [bunch.arrivals[-1]] * len(bunch.packets))
        if self._holding is not None:
            self._holding.cancel()
            self._holding = None
        if (due := self._bunches.due) < math.inf:
            self._holding = self._loop.call_later(max(due - now, 0.0), self.read)

    def _clocks(self) -> tuple[float, float]:
        """The time in s, and the wall clock's lead over it, read so that a stall does not look like a step."""
        while True:
            before, wall, now = self._clock(), time.time(), self._clock()
            if now - before < STEP_S:
                return now, wall - now

    def _receive(self) -> tuple[list[Packet], list[bytes], bool]:
        """(packets with their sources, the kernel's time of each, whether some may be left in the socket).

        It reads at most GROUP packets, so that others have their turn.
        """
        receive = self._sock.recvmsg
        found, stamps = list[Packet](), list[bytes]()
        try:
            for _ in range(GROUP):
                packet, ancillary, _, source = receive(PACKET_BYTES, ANCILLARY_BYTES)
                found.append((packet, source[:2]))  # one of IPv6 has a flow and a scope, too
                stamps.append(ancillary[0][2] if ancillary else UNKNOWN)
        except (BlockingIOError, InterruptedError):
            return found, stamps, False
        except (OSError, MemoryError) as error:  # an error that is about no packet here; the socket can still be read
            self._desk.drop("socket_error", error=str(error))
        return found, stamps, True

    def _arrivals(self, stamps: list[bytes], now: float) -> list[float]:
        """When packets came by these times of the kernel, in s of the monotonic clock; the arrivals never decrease.

        No packet came before the socket was empty, nor after `now`, which counts for times that are unknown.
        """
        arrivals = list[float]()
        last, wall = self._empty, self._wall
        for seconds, nanoseconds in TIMESTAMP.iter_unpack(b"".join(stamps)):
            came = seconds + nanoseconds / 1e9 - wall
            if came > last:
                last = came if came < now else now
            arrivals.append(last)
        return arrivals

    def _work(self, now: float) -> None:
        """Serve packets of the backlog for a slice of time."""
        if self._backlog.flooded(now):
            self._work_fairly(now)
            return
        end, before = now + SLICE_S, time.thread_time()
        while self._backlog and self._clock() < end:
            self._serve(*self._backlog.group())
        self._backlog.worked(time.thread_time() - before, self._clock())

    def _work_fairly(self, now: float) -> None:
        served, dropped = self._backlog.share(self._slice(now), now)
        start = before = time.thread_time()  # processor time, since no sender is to blame if we have to wait for it
        for n, group in enumerate(served):
            if before > start + TURN_S:
                for packet, source in chain.from_iterable(left.packets for left in served[n:]):
                    dropped.setdefault(self._backlog.sender(source), []).append(packet)
                break
            self._serve(group.packets, group.arrival)
            after = time.thread_time()
            self._backlog.took(group, after - before)
            before = after
        if dropped:
            self._desk.drop("flood", count=sum(map(len, dropped.values())))
            self._hub.missed()
            if blamed := self._muted.blame(dropped, now, self._hub.owners):
                self._desk.muted(blamed)
                self._mute(now, blamed)
                self._backlog.flood(now + LONGEST_S + FLOOD_S)  # senders that are heard again are limited at once

    def _slice(self, now: float) -> float:
        """The duration of the work in this turn of a flood, in s.

        The kernel's buffer fills meanwhile, but packets that are served together cost a fraction. So work goes on until
        half of what a read takes has come again, unless the last read may have left packets in the socket.
        """
        least, most = FLOOD_SLICE_S
        full, since, self._shared = self._backlog.full, now - self._shared, now
        return min(max(since / 2 / full, least), most) if full < 1 else least

    def _mute(self, now: float, changed: Sequence[Sender]) -> None:
        """Have the kernel drop packets of muted senders, which would fill the socket's buffer before they are read."""
        if changed:
            try:
                mute(self._sock, self._muted.rules(now, self._hub.owners))
            except OSError as error:
                self._desk.drop("socket_error", count=0, error=f"a sender cannot be muted: {error}")

    def _serve(self, packets: Sequence[Packet], now: float) -> None:
        if self._taps.active:
            self._taps.packets(packets, now)
        self._desk.take(self._hub.receive(packets, now))
        self._expect()

    def _ask(self) -> None:
        """Have the model classify one segment before its answer is due; then everybody else in the loop has a turn."""
        self.read()
        if self._again is None:
            self._desk.take(self._hub.ask(self._clock()))
            self._set_anew()
        self._asking = self._loop.call_soon(self._ask) if self._hub.asks else None

    def _foresee(self) -> None:
        """Give a provisional event if nothing else is to be done, since it takes a run of the model."""
        self.read()
        took_s = 0.0
        if self._again is None:
            began = self._clock()
            self._desk.take(self._hub.look(began))
            took_s = self._clock() - began
            self._set_anew()
        pause_s = PAUSE_S + REST * took_s
        self._foreseeing = self._loop.call_later(pause_s, self._foresee) if self._hub.looks else None

    def _expect(self) -> None:
        """Set the alarm for the moment when time alone decides something. Packets that wait are served before it."""
        if self._hub.asks and self._asking is None:
            self._asking = self._loop.call_soon(self._ask)
        if self._hub.looks and self._foreseeing is None:
            self._foreseeing = self._loop.call_soon(self._foresee)
        if self._hub.due != self._due and not self._backlog:
            self._forget_alarm()
            self._due = self._hub.due
            if self._due < math.inf:
                woken = self._due - EARLY_S if self._sparse else self._due + EARLY_S
                self._alarm = self._loop.call_later(max(woken - self._clock(), 0.0), self._wait)

    def _set_anew(self) -> None:
        """Set the alarm anew after a run of the model, by which it would be late otherwise.

        libuv computes the length of its sleep from its last look at the clock. It does not look after a callback, but
        whenever a timer is set.
        """
        self._forget_alarm()
        self._expect()

    def _wait(self) -> None:
        """Decide what is due. A millisecond before, come back in each turn of the loop, which serves everybody else."""
        if self._clock() < self._due:
            self._alarm = self._loop.call_soon(self._wait)
        else:
            self.read()
            self._desk.take(self._hub.wait(self.served))
            self._forget_alarm()  # `read` may have set an alarm for what is decided by now, too
            self._expect()

    def _forget_alarm(self) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
        self._due, self._alarm = math.inf, None

    def _count_drops(self, now: float) -> None:
        """If the kernel has dropped packets since the last look, tell the hub; if it keeps doing so, begin a flood."""
        drops = kernel_drops(self._sock)
        if drops == self._drops:
            return
        self._drops = drops
        self._hub.missed()
        if self._dropping <= now - FULL_S <= self._dropping + FLOOD_S:  # it still drops: more comes than we can read
            self._backlog.flood(now + FLOOD_S)
        elif now > self._dropping + FLOOD_S:
            self._dropping = now
