"""The TUIO 1.1 sink: fingers as cursors (`/tuio/2Dcur`) over UDP. Each sensor is a source of TUIO."""

import socket
import time
from dataclasses import dataclass, field

from gestured.core.address import Address
from gestured.core.events import Event, Status, Touch
from gestured.daemon.metrics import Metrics
from gestured.daemon.sinks import UdpOut

TUIO = "tuio"  # the scheme of a TUIO destination
CURSOR = "/tuio/2Dcur"
FRAMES = 2**31  # frame numbers begin anew here, since those of TUIO are int32
SESSIONS = 2**24  # session ids begin anew here, since some programs keep them as float32


@dataclass(slots=True)
class Cursor:
    """A finger that is down, as TUIO knows it."""

    session: int
    t: float  # s
    speed: float = 0.0  # sides of the sensor a second


@dataclass(slots=True)
class Source:
    """One sensor: its fingers by contact and number."""

    cursors: dict[tuple[int, int], Cursor] = field(default_factory=dict)
    idle: bytes = b""  # the packet of a frame without fingers, but for its last four bytes, the frame's number


class TuioSink(UdpOut):
    """TUIO to one destination: `alive` and `set` with each event of a finger, `alive` alone once a second."""

    wants = frozenset({"touch"})

    def __init__(self, destination: Address, metrics: Metrics) -> None:
        super().__init__(destination, metrics)
        self._sources: dict[str, Source] = {}  # by sensor
        self._host = socket.gethostname()
        # The next session and the last frame begin above those of an earlier start: a program may have kept a finger
        # of that, and drops frames with numbers below those that it has seen, many programs whatever the source is.
        self._sessions = int(10 * time.time()) % SESSIONS
        self._frames = int(1000 * time.time()) % FRAMES

    def publish(self, event: Event, epoch: float, *, test: bool = False) -> None:
        """Send where a finger is, or that it has left; with the status, which fingers are down."""
        if isinstance(event, Status):
            here = {name: one for name, one in self._sources.items() if name in event.sensors or one.cursors}
            self._sources = {name: Source() for name in event.sensors} | here
            for sensor in self._sources:
                self._bundle(sensor)
        elif isinstance(event, Touch):
            cursors = self._sources.setdefault(event.sensor, Source()).cursors
            key = event.id, event.touch
            if event.phase == "up":
                cursors.pop(key, None)
                self._bundle(event.sensor)
                return
            if key not in cursors:  # came down just now, or before this destination was opened
                cursors[key] = Cursor(self._sessions, event.t)
                self._sessions = (self._sessions + 1) % SESSIONS
            self._bundle(event.sensor, cursors[key], event)

    def take_over(self, before: UdpOut) -> None:
        """Go on with the same fingers and numbers."""
        super().take_over(before)
        if isinstance(before, TuioSink) and before.destination == self.destination:
            self._sources, self._sessions, self._frames = before._sources, before._sessions, before._frames
            before._sources = {}

    def close(self) -> None:
        """Say that no finger is there any more, then close the socket."""
        for sensor, source in self._sources.items():
            source.cursors.clear()
            self._bundle(sensor)
        super().close()

    def _bundle(self, sensor: str, cursor: Cursor | None = None, moved: Touch | None = None) -> None:
        """Send a frame of a sensor: the fingers that are down, and perhaps how one moved. TUIO's y grows downward."""
        source = self._sources[sensor]
        alive = [one.session for one in source.cursors.values()]
        self._frames = (self._frames + 1) % FRAMES
        if source.idle and not alive:
            self.send(source.idle + self._frames.to_bytes(4, "big"))
            return
        messages = [
            self._out.message(CURSOR, "ss", ("source", f"gestured/{sensor}@{self._host}")),
            self._out.message(CURSOR, "s" + "i" * len(alive), ("alive", *alive)),
        ]
        if cursor is not None and moved is not None:
            took = moved.t - cursor.t
            right, down = (moved.dx / took, -moved.dy / took) if took > 0 else (0.0, 0.0)
            speed = (right**2 + down**2) ** 0.5
            faster = (speed - cursor.speed) / took if took > 0 else 0.0
            cursor.t, cursor.speed = moved.t, speed
            place = (cursor.session, moved.x, 1.0 - moved.y, right, down, faster)
            messages.append(self._out.message(CURSOR, "sifffff", ("set", *place)))
        messages.append(self._out.message(CURSOR, "si", ("fseq", self._frames)))
        packet: bytes = self._out.bundle(*messages).dgram
        if not alive:
            source.idle = packet[:-4]
        self.send(packet)
