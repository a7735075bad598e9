"""A real sensor over OSC/UDP, decoded, stamped and cut as the daemon does it; a take of what it felt."""

import math
import socket
import time
from collections import deque
from collections.abc import Sequence

import numpy as np

from gestured.client.say import shown
from gestured.core.errors import GesturedError
from gestured.core.events import Cancelled, Onset, Release
from gestured.core.frames import Frame
from gestured.core.front_end import Contact, Cut, FrontEnd
from gestured.core.stamping import Stamper
from gestured.core.wire import Addresses, Arrival, Decoder
from gestured.lab.recordings.quality import Take

PACKET_BYTES = 65_536
RECEIVE_BYTES = 4 << 20
HISTORY_S = 30.0  # frames that are kept; longer than any wait for a gesture
LEAD_S = 1.2  # of idle sensor kept before a gesture: the front end learns from a second of it
SILENT_S = 2.0
WHY = {
    "glitch": "shorter than any finger's touch",
    "stuck": "only taxels that are out of order changed",
    "held": "held too long",
    "restart": "the sensor started anew",
    "silence": "the sensor fell silent",
}


class LiveSensor:
    """The first sensor that sends to `address`, or the one called `name`. Raises GesturedError where it cannot listen.

    `pump` reads; what the front end cut since `begin` is `contacts`.
    """

    def __init__(self, address: tuple[str, int], rows: int, columns: int, name: str | None, rate_hz: float) -> None:
        self.where = f"{address[0]}:{address[1]}"
        self.front = FrontEnd(name or "sensor", rows, columns)
        self.name = name
        self.contacts: list[Contact] = []
        self._decoder = Decoder(Addresses(), lambda _: (rows, columns))
        self._stamper = Stamper(rate_hz=rate_hz)
        self._frames: deque[Frame] = deque()
        self._free = -math.inf  # s, when the last contact was over
        self._before = -math.inf  # s, the same at `begin`
        self._source: object = None
        self._heard = time.monotonic()
        self._wrong = ""
        try:
            family, kind, _, _, where = socket.getaddrinfo(*address, type=socket.SOCK_DGRAM)[0]
            self.socket = socket.socket(family, kind | socket.SOCK_NONBLOCK)
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
            self.socket.bind(where)
        except OSError as error:
            reason = error.strerror or error
            raise GesturedError(f"cannot listen on {self.where}: {reason}; does a daemon listen there?") from None

    def close(self) -> None:
        """Stop listening."""
        self.socket.close()

    @property
    def now(self) -> float:
        """The last frame's time in seconds, -inf before the first."""
        return self._frames[-1].t if self._frames else -math.inf

    @property
    def rate_hz(self) -> float:
        """Frames a second as they came, 0 before it is known."""
        steps = np.diff([frame.t for frame in self._frames])
        return 1.0 / float(np.median(steps)) if len(steps) else 0.0

    @property
    def silent(self) -> bool:
        """Whether no frame has come for a while."""
        return time.monotonic() - self._heard > SILENT_S

    def trouble(self) -> str:
        """What keeps frames from arriving, in words."""
        who = f"no frames of {self.name or 'a sensor'} arrive on {self.where}"
        return shown(f"{who} ({self._wrong})" if self._wrong else who)

    def pump(self) -> None:
        """Take what waits in the socket."""
        arrivals: list[Arrival] = []
        while True:
            try:
                packet, source = self.socket.recvfrom(PACKET_BYTES)
            except BlockingIOError:
                break
            except OSError:  # the network's complaint about something else; the socket goes on
                continue
            found, errors = self._decoder.decode(packet, source)
            if errors:
                self._wrong = str(errors[-1])
            arrivals += [arrival for arrival in found if self._ours(arrival, source)]
        if arrivals:
            self._take(arrivals, time.monotonic())

    def _ours(self, arrival: Arrival, source: object) -> bool:
        """As in the daemon: a sensor belongs to the source that sent it first, until it has been silent."""
        if self.name is None:
            self.name = arrival.sensor
        if arrival.sensor != self.name:
            self._wrong = f"{arrival.sensor} sends"
            return False
        if self._source is None or self.silent:
            self._source = source
        return source == self._source

    def _take(self, arrivals: Sequence[Arrival], now: float) -> None:
        self._heard, self._wrong = now, ""
        for arrival, stamp in zip(arrivals, self._stamper.stamp(arrivals, now), strict=True):
            if stamp.dropped:
                continue
            contacts = self.front.reset() if stamp.restarted else []
            frame = Frame(stamp.t, arrival.values, arrival.touches, stamp.lost)
            contacts += self.front.push(frame)
            self._frames.append(frame)
            self.contacts += contacts
            if any(isinstance(contact, Release) for contact in contacts):
                self._free = stamp.t
        while self._frames[0].t < self._frames[-1].t - HISTORY_S:
            self._frames.popleft()

    def begin(self) -> None:
        """From now on it counts."""
        self.contacts = []
        self._before = self._free

    @property
    def onset(self) -> float | None:
        """When the first contact since `begin` began."""
        return next((contact.onset for contact in self.contacts if isinstance(contact, Onset)), None)

    def quiet(self, seconds: float) -> bool:
        """Whether there was a contact since `begin`, and nothing for so long after it."""
        over = any(isinstance(contact, Release) for contact in self.contacts)
        return over and not self.front.touched and self.now - self._free >= seconds

    def take(self) -> Take | None:
        """What was felt since `begin`; None where nothing was."""
        onset = self.onset
        if onset is None:
            return None
        cuts = [contact.segment for contact in self.contacts if isinstance(contact, Cut)]
        released = [contact.offset for contact in self.contacts if isinstance(contact, Release)]
        reasons = [contact.reason for contact in self.contacts if isinstance(contact, Cancelled)]
        first = cuts[0].onset if cuts else onset
        last = cuts[-1].offset if cuts else released[-1] if released else self.now
        trouble = ""
        if len(cuts) > 1:
            trouble = f"{len(cuts)} gestures were seen, expected one"
        elif not cuts:
            trouble = WHY.get(reasons[0], reasons[0]) if reasons else "not let go"
        start = min(max(first - LEAD_S, self._before), first)
        frames = tuple(frame for frame in self._frames if frame.t >= start)
        marks = np.searchsorted([frame.t for frame in frames], [first, last])
        return Take(frames, int(marks[0]), min(int(marks[1]), len(frames) - 1), self.front.noise, trouble)
