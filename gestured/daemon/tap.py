"""Taps: packets as they arrived, with the events they led to, for recordings and for the flight recorder.

A packet is kept as the bytes that came, before they are decoded, with the time at which the hub got it, so that a
recording replays through the same code to the same events. Nothing is kept or copied as long as nobody taps and no
flight recorder is set. Lines are sent to a live tap only after a short while, so that no event waits for them.
"""

import asyncio
import base64
import time
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import islice

from gestured.core import messages
from gestured.core.events import Event, Gate, Status, Touch
from gestured.core.hub import REMEMBERED
from gestured.core.messages import json_line
from gestured.core.owner import Source
from gestured.daemon.request import Connection

KEPT_S = 30.0  # how long the flight recorder keeps a packet
OVERHEAD_BYTES = 200  # what Python adds to a packet that it keeps
EVENT_BYTES = 1500  # of memory for an event, with the scores and the place of a gesture
SOON_S = 0.025  # how long a packet's line waits, so that other sensors' packets that came with it are answered first
TURN_LINES = 32  # lines that are made and sent before the loop serves frames again
Remembered = tuple[int, Source, bytes] | Event  # a packet with its time in ns (monotonic), or an event


class Taps:
    """Live taps, and the ring of the flight recorder."""

    def __init__(self, ring_bytes: int) -> None:
        """Remember the last KEPT_S seconds, but never more than `ring_bytes` (0: nothing)."""
        self.ring_bytes = ring_bytes
        self._live: list[Connection] = []
        self._waiting: deque[Remembered] = deque()  # packets and events that are to be streamed soon
        self._timer: asyncio.Handle | None = None
        self._ring: deque[tuple[int, int, Remembered]] = deque()  # ns, bytes held, packet or line
        self.held_bytes = 0  # in the ring
        self._epoch_ns = 0  # of the live taps
        # By sensor, the latest last: the `Gate` that holds at the beginning of the ring.
        self._gates: dict[str, Gate] = {}

    @property
    def active(self) -> bool:
        """Whether a tap or the flight recorder wants packets."""
        return bool(self.ring_bytes or self._live)

    @property
    def count(self) -> int:
        """How many live taps there are."""
        return len(self._live)

    @property
    def epoch_ns(self) -> int:
        """Nanoseconds from 1970 to the 0 of the loop's clock; constant while anybody taps.

        So the events of a recording keep their place among its packets, even if the machine has slept meanwhile. It is
        never negative, as by a clock that was set back to 1970: a tape holds no time before that.
        """
        return self._epoch_ns if self._live else max(time.time_ns() - time.monotonic_ns(), 0)

    def join(self, connection: Connection) -> None:
        """Stream to this connection from now on."""
        self.flush()
        self._epoch_ns = self.epoch_ns
        connection.streams, connection.flush = True, self.flush
        self._live.append(connection)

    def packets(self, waiting: Sequence[tuple[bytes, Source]], now: float) -> None:
        """Take packets that were served together at `now` (monotonic s)."""
        t_ns = round(now * 1e9)
        for packet, source in waiting:
            self._remember(t_ns, len(packet) + OVERHEAD_BYTES, (t_ns, source, packet))

    def publish(self, event: Event, epoch: float, *, test: bool = False) -> None:
        """Take an event, as a sink. The status and a test are left out, since no packet led to them.

        Touch events are left out as well, since the packets say the same.
        """
        if self.active and not test and not isinstance(event, Status | Touch):
            self._remember(time.monotonic_ns(), EVENT_BYTES, event)

    def flush(self) -> None:
        """Stream now all that waits."""
        while self._waiting:
            self._stream()

    def flight(self) -> deque[Remembered]:
        """The content of the ring, oldest first: packets and events themselves, not copies of them."""
        self._forget(time.monotonic_ns())
        return deque((*self._gates.values(), *(what for _, _, what in self._ring)))

    def tick(self) -> None:
        """Tell slow readers how many packets they lost, forget readers that are gone; call it once a second."""
        self._live = [connection for connection in self._live if not connection.closed]
        for connection in self._live:
            lost, connection.lost = connection.lost, 0
            if lost and not connection.send(messages.lost_json(lost)):
                connection.lost += lost - 1  # `send` has counted its own line, which is no packet
        self._forget(time.monotonic_ns())

    def _remember(self, t_ns: int, size: int, what: Remembered) -> None:
        if self._live:
            self._waiting.append(what)
            if self._timer is None:
                self._timer = asyncio.get_running_loop().call_later(SOON_S, self._turn)
        if self.ring_bytes:
            self._ring.append((t_ns, size, what))
            self.held_bytes += size
            self._forget(t_ns)

    def _turn(self) -> None:
        if self._waiting:
            self._stream()
        self._timer = asyncio.get_running_loop().call_soon(self._turn) if self._waiting else None

    def _stream(self) -> None:
        """Send the next few lines to all live taps, in one write each, since a write for each line costs too much."""
        lines = list(islice(as_lines(self._waiting, self._epoch_ns), TURN_LINES))
        text = b"".join(lines)
        for connection in self._live:
            connection.send(text, lines=len(lines))

    def _forget(self, now_ns: int) -> None:
        oldest = now_ns - round(KEPT_S * 1e9)
        while self._ring and (self.held_bytes > self.ring_bytes or self._ring[0][0] < oldest):
            _, size, what = self._ring.popleft()
            self.held_bytes -= size
            if isinstance(what, Gate):
                self._gates.pop(what.sensor, None)
                self._gates[what.sensor] = what
                if len(self._gates) > REMEMBERED:  # a peer chooses the names of sensors
                    del self._gates[next(iter(self._gates))]


def as_lines(remembered: deque[Remembered], epoch_ns: int) -> Iterator[bytes]:
    """Packets and events as lines of the control socket. Each is taken out of `remembered`, to free its memory.

    A packet's line has its time in ns (monotonic), its source, and its bytes as base64. Times of events are made with
    `epoch_ns`, which the reader adds to those of packets, since the wall clock may have been set after the event.
    """
    while remembered:
        what = remembered.popleft()
        if not isinstance(what, tuple):
            yield messages.to_json(what, epoch_ns / 1e9)
        else:
            t_ns, source, packet = what
            data = base64.b64encode(packet).decode()
            yield json_line({"type": "packet", "t_ns": t_ns, "source": source[:2], "data": data})
