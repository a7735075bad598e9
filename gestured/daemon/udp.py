"""OSC over UDP in: reads what waits, decodes it, and hands each sensor its frames.

A reader of its own instead of a DatagramProtocol: it takes everything that waits before it looks at the
clock, so that after a stall of the loop the frames are spread over the time they took, and it costs less per
packet. Where packets come thick, as of hundreds of sensors, it takes them together, about every millisecond.
"""

import asyncio
import ipaddress
import socket
import time
from collections.abc import Callable, Sequence

from gestured.core.wire import Arrival, Decoder
from gestured.daemon.pipeline import Pipeline, Sensor
from gestured.daemon.rations import Rations
from gestured.owner import Source

PACKET_BYTES = 65_536
BATCH = 256  # packets in one go, and
BATCH_BYTES = 256 << 10  # so many bytes: a flood must leave room for everything else
CATCH_UP = 16  # batches, and
CATCH_UP_S = 0.25
PAUSE_S = 0.001  # after packets that come closer together than this we wait as long for more of them,
FEW = 8  # where no more than these were waiting: to be woken for each one is a large part of its price
SOURCES = 1024  # remembered decisions of the allow-list

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


def allowed(host: str, networks: Sequence[Network]) -> bool:
    """Whether a host's address lies in one of the networks; any does where there are none."""
    address = ipaddress.ip_address(host)
    mapped = getattr(address, "ipv4_mapped", None)
    return not networks or any((mapped or address) in network for network in networks)


class Receiver:
    """Reads a UDP socket until it is closed. `decoder` and `allow` may be replaced at any time."""

    def __init__(
        self,
        sock: socket.socket,
        pipeline: Pipeline,
        decoder: Decoder,
        allow: Sequence[Network],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._sock, self._pipeline, self._clock = sock, pipeline, clock
        self.tap: Callable[[Sequence[tuple[bytes, Source]], float], None] | None = None  # is shown what is read
        self._rations = Rations()
        self.configure(decoder, allow)
        self._looked = 0.0  # s, when we last looked whether something waits
        self._found = 0  # packets, then
        self._pause: asyncio.TimerHandle | None = None
        self._loop.add_reader(sock, self._wake)

    def configure(self, decoder: Decoder, allow: Sequence[Network]) -> None:
        """Decode and admit by these from now on."""
        self._decoder, self._allow = decoder, tuple(allow)
        self._known: dict[str, bool] = {}

    def close(self) -> None:
        """Stop reading; the socket stays its owner's."""
        self._loop.remove_reader(self._sock)
        if self._pause is not None:
            self._pause.cancel()

    def _wake(self) -> None:
        now = self._clock()
        thick = now - self._looked < PAUSE_S
        self._looked = now
        self.read()
        if thick and self._found <= FEW:
            self._loop.remove_reader(self._sock)
            self._pause = self._loop.call_later(PAUSE_S, self._listen)

    def _listen(self) -> None:
        self._looked = self._clock()
        self._loop.add_reader(self._sock, self._wake)

    def read_all(self) -> None:
        """Take everything that waits, within reason: after a stall timers run before readers do."""
        end = self._clock() + CATCH_UP_S
        for _ in range(CATCH_UP):
            if not self.read() or self._clock() >= end:
                break

    def read(self) -> bool:
        """Take what waits, at most a batch; says whether it has left something behind."""
        receive = self._sock.recvfrom
        waiting: list[tuple[bytes, Source]] = []
        room = BATCH_BYTES * (BATCH if self._rations.on(self._clock()) else 1)  # what is not served costs little
        full = False
        try:
            while len(waiting) < BATCH and room > 0:
                datagram = receive(PACKET_BYTES)
                waiting.append(datagram)
                room -= len(datagram[0])
            full = True
        except (BlockingIOError, InterruptedError):
            pass
        except (OSError, MemoryError) as error:  # the network's complaint about something else; the socket goes on
            self._pipeline.drop("socket_error", error=str(error))
        self._found = len(waiting)
        now = self._clock()
        served = self._rations.share(waiting, full, now)
        if len(served) < len(waiting):
            self._pipeline.drop("flood", count=len(waiting) - len(served))
            waiting = served
        if self.tap is not None and waiting:
            self.tap(waiting, now)
        batch: dict[str, tuple[Sensor, list[Arrival]]] = {}
        for packet, source in waiting:
            try:
                self._packet(packet, source, now, batch)
            except Exception:  # what came before and after it in this batch is good
                self._pipeline.bug("in the decoding of a packet", source=source[0])
        for sensor, arrivals in batch.values():
            self._pipeline.take(sensor, arrivals, now)
        return full

    def _packet(
        self, packet: bytes, source: Source, now: float, batch: dict[str, tuple[Sensor, list[Arrival]]]
    ) -> None:
        if self._allow and not self._may_send(source[0]):
            self._pipeline.drop("not_allowed", source=source[0])
            return
        arrivals, errors = self._decoder.decode(packet, source)
        for error in errors:
            self._pipeline.drop(error.reason, source=source[0], error=str(error))
        for arrival in arrivals:
            name = arrival.sensor
            sensor = self._pipeline.admit(name, source, now)
            if sensor is not None:
                if name not in batch:
                    batch[name] = (sensor, [])
                batch[name][1].append(arrival)

    def _may_send(self, host: str) -> bool:
        known = self._known.get(host)
        if known is None:
            if len(self._known) >= SOURCES:
                self._known.clear()
            known = self._known[host] = allowed(host, self._allow)
        return known
