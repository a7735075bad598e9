"""A real sensor over OSC/UDP, decoded, stamped and cut as in the daemon, and takes of its frames."""

import math
import socket
import time
from collections import deque

import numpy as np

from gestured.client.address import look_up
from gestured.client.say import shown
from gestured.core.address import Address
from gestured.core.beside.reading import Reading
from gestured.core.classifier import Classifier
from gestured.core.errors import GesturedError
from gestured.core.events import Cancelled, Event, Onset, Release, Status
from gestured.core.facts import Arrived, Changed, Decided, Dropped, Fact, Fault, Taken
from gestured.core.frames import Frame
from gestured.core.hub import Hub
from gestured.core.owner import Source
from gestured.core.scene import Scene
from gestured.lab.recordings.quality import Captured

PACKET_BYTES = 65_536
RECEIVE_BYTES = 4 << 20
HISTORY_S = 30.0  # frames that are kept; longer than any wait for a gesture
KEPT_IDLE_S = 1.2  # of idle sensor kept before a gesture: the front end learns from a second of it
SENSOR_GONE_S = 2.0
WHY = {
    "glitch": "shorter than any finger's touch",
    "stuck": "only taxels that are out of order changed",
    "held": "held too long",
    "restart": "the sensor started anew",
    "silence": "the sensor fell silent",
}


class LiveSensor:
    """The first sensor that sends to `address`, or the one called `name`. Raises GesturedError if it cannot listen.

    `classifier` says what each take looks like. `pump` reads packets; `found` holds the events since `begin`.
    """

    def __init__(self, address: Address, grid: tuple[int, int], name: str | None, classifier: Classifier) -> None:
        self.where = str(address)
        self.name = name
        self.grid = grid
        self.ready = False  # the idle sensor is known
        self.found: list[Event | Decided] = []
        self._gestures = classifier.gestures
        self._hub = Hub(Scene(classifier.gestures, grid, touches=True, frames=True), classifier)
        self._frames: deque[Frame] = deque()
        self._free = -math.inf  # s, when the last contact was over
        self._before = -math.inf  # s, `_free` at the last `begin`
        self._heard = time.monotonic()
        self._wrong = ""
        try:
            family, where = look_up(address, socket.SOCK_DGRAM)
            self.socket = socket.socket(family, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
            self.socket.bind(where)
        except OSError as error:
            reason = error.strerror or error
            raise GesturedError(f"cannot listen on {self.where}: {reason}; does a daemon listen there?") from error

    def close(self) -> None:
        """Stop listening to the sensor."""
        self.socket.close()

    @property
    def now(self) -> float:
        """The last frame's time in seconds, -inf before the first."""
        return self._frames[-1].t if self._frames else -math.inf

    @property
    def rate_hz(self) -> float:
        """Frames a second as they arrive; 0 before this is known."""
        steps = np.diff([frame.t for frame in self._frames])
        return 1.0 / float(np.median(steps)) if len(steps) else 0.0

    @property
    def silent(self) -> bool:
        """Whether no frame has come for a while."""
        return time.monotonic() - self._heard > SENSOR_GONE_S

    def trouble(self) -> str:
        """What keeps frames from arriving, in words."""
        who = f"no frames of {self.name or 'a sensor'} arrive on {self.where}"
        return shown(f"{who} ({self._wrong})" if self._wrong else who)

    @property
    def touched(self) -> bool:
        """Whether a contact is going on."""
        return self._reading is not None and self._reading.touched

    @property
    def _reading(self) -> Reading | None:
        return self._hub.readings(time.monotonic()).get(self.name or "")

    def pump(self) -> None:
        """Process the packets that wait in the socket."""
        waiting: list[tuple[bytes, Source]] = []
        while True:
            try:
                waiting.append(self.socket.recvfrom(PACKET_BYTES))
            except BlockingIOError:
                break
            except OSError:  # an error that the network reports about other packets; the socket still works
                continue
        now = time.monotonic()
        for fact in [*self._hub.receive(waiting, now), *self._hub.tick(now)]:
            self._see(fact, now)
        while self._frames and self._frames[0].t < self._frames[-1].t - HISTORY_S:
            self._frames.popleft()

    def _see(self, fact: Fact, now: float) -> None:
        if isinstance(fact, Fault):
            raise fact.error
        if isinstance(fact, Dropped):
            self._wrong = fact.text or self._wrong
            return
        if self.name is None and isinstance(fact, Changed):
            self.name = fact.sensor
        if isinstance(fact, Arrived | Changed | Status):
            return
        if fact.sensor != self.name:
            self._wrong = f"{fact.sensor} sends"
        elif isinstance(fact, Taken):
            self._heard, self._wrong = now, ""
            self._frames.append(fact.frame)
            self.ready = fact.ready
        else:
            self.found.append(fact)
            if isinstance(fact, Release):
                self._free = self.now

    def begin(self) -> None:
        """Begin a take; earlier contacts do not belong to it."""
        self.found = []
        self._before = self._free

    @property
    def onset(self) -> float | None:
        """When the first contact since `begin` began, in s; None without one."""
        return next((contact.onset for contact in self.found if isinstance(contact, Onset)), None)

    def quiet(self, seconds: float) -> bool:
        """Whether there was a contact since `begin`, and nothing for so long after it."""
        over = any(isinstance(contact, Release) for contact in self.found)
        return over and not self.touched and self.now - self._free >= seconds

    def take(self) -> Captured | None:
        """The take since `begin`; None without a contact."""
        onset = self.onset
        if onset is None:
            return None
        decided = [contact for contact in self.found if isinstance(contact, Decided)]
        cuts = [contact.segment for contact in decided]
        released = [contact.offset for contact in self.found if isinstance(contact, Release)]
        reasons = [contact.reason for contact in self.found if isinstance(contact, Cancelled)]
        first = cuts[0].onset if cuts else onset
        last = cuts[-1].offset if cuts else released[-1] if released else self.now
        trouble = ""
        if len(cuts) > 1:
            trouble = f"{len(cuts)} gestures were seen, expected one"
        elif not cuts:
            trouble = WHY.get(reasons[0], reasons[0]) if reasons else "not let go"
        start = min(max(first - KEPT_IDLE_S, self._before), first)
        frames = tuple(frame for frame in self._frames if frame.t >= start)
        begin, end = np.searchsorted([frame.t for frame in frames], [first, last]).tolist()
        noise, looks, sure = self._reading.noise if self._reading else 0.0, "", 0.0
        if len(decided) == 1 and len((scores := decided[0].scores).values) == len(self._gestures):
            looks, sure = self._gestures[int(scores.values.argmax())], scores.confidence
        return Captured(frames, begin, min(end, len(frames) - 1), noise, trouble, looks, sure)
