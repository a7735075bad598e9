"""The desk for the hub's facts: events go to every sink, other facts are counted, logged and shown to observers."""

import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from typing import Any

from gestured.core import messages
from gestured.core.address import Address
from gestured.core.events import Cancelled, Event, Gesture, Status, Touch, Unknown
from gestured.core.facts import Arrived, Changed, Decided, Dropped, Fact, Fault, Taken
from gestured.core.hub import Hub
from gestured.daemon.log import Throttle, log
from gestured.daemon.metrics import Metrics
from gestured.daemon.own import OwnGestures
from gestured.daemon.shift import Shift
from gestured.daemon.sinks import Sink
from gestured.daemon.views import Views

RECENT = 10  # answers that `gesturectl status` shows
CHANGES = {"silent": "sensor is silent", "restarted": "sensor restarted"}


class Desk:
    """Takes the hub's facts, the events of tests, and the packets that the receiver has dropped."""

    def __init__(self, hub: Hub, metrics: Metrics, shift: Shift, own: OwnGestures, views: Views) -> None:
        self._hub, self._metrics, self._own, self._views = hub, metrics, own, views
        self.sinks: tuple[Sink, ...] = ()  # may be replaced between two events
        self.shift = shift  # how the segments differ from the training data of the model that answers
        self.models_failed = False  # whether no model could answer the last segment
        self.recent: deque[dict[str, Any]] = deque(maxlen=RECENT)  # the last answers, oldest first
        self._throttle = Throttle()

    def take(self, facts: Sequence[Fact]) -> None:
        """Publish the events among the facts, count and log the others, and show them to observers at last."""
        decided: list[Decided] = []
        for fact in facts:
            if isinstance(fact, Arrived):
                self._count(fact)
            elif isinstance(fact, Decided):
                self._metrics.inference.observe(fact.scores.took_s, fact.scores.model)
                decided.append(fact)
            elif isinstance(fact, Dropped):
                self.drop(fact.reason, source=fact.source[0], error=fact.text)
            elif isinstance(fact, Changed):
                self._changed(fact)
            elif isinstance(fact, Fault):
                self.bug("in the path of a sensor; its front end is reset", fact.error, sensor=fact.sensor)
            elif not isinstance(fact, Taken):
                self.publish(fact)
        if decided:
            self._beside("in what compares segments with the training's", self.shift.see, decided)
        if self._own.enrolling:
            self._beside("in what judges an example", self._own.see, facts)
        self._views.see(facts)

    def publish(self, event: Event, *, test: bool = False) -> None:
        """Give an event to every sink, then count it. A `test` is made up, so it is not counted as an answer."""
        # The largest of three, since it becomes smaller if another program runs between the readings of the two clocks.
        epoch = max(time.time() - time.monotonic() for _ in range(3))
        for sink in self.sinks:
            try:
                sink.publish(event, epoch, test=test)
            except Exception as error:  # a bug in one sink must not keep the event from the others
                self.bug(f"in the sink {type(sink).__name__}", error)
        if isinstance(event, Touch):
            return  # touch events come up to 60 times a second and are no answers
        if not test:
            late_s = 0.0  # since the decision; if only the sensor's own clock knows the time of that, we do not
            if isinstance(event, Gesture | Unknown) and self._hub.scene.clock_of(event.sensor) == "arrival":
                late_s = time.monotonic() - event.decided
            self._metrics.event(event, late_s)
            if isinstance(event, Gesture | Unknown):
                self.models_failed = False
            elif isinstance(event, Cancelled) and event.reason == "model":
                self.models_failed = True
        if isinstance(event, Gesture | Unknown | Cancelled):
            self.recent.append(_answer(event, epoch, test))
        if not isinstance(event, Status):
            name = getattr(event, "gesture", None)
            log.debug(messages.event_type(event), sensor=event.sensor, id=getattr(event, "id", None), gesture=name)

    def drop(self, reason: str, count: int = 1, **fields: object) -> None:
        """Count packets that were dropped; log the reason at a bounded rate."""
        self._metrics.dropped.add(reason, count=count)
        self._throttle.warn("dropped", reason, **{name: value for name, value in fields.items() if value})

    def muted(self, senders: Sequence[tuple[str, int] | str]) -> None:
        """Log at a bounded rate that these senders of a flood are muted for a while."""
        names = [sender if isinstance(sender, str) else str(Address(*sender[:2])) for sender in senders]
        self._throttle.warn("senders of a flood are not heard for some seconds", "muted", senders=names)

    def bug(self, what: str, error: BaseException | None = None, **fields: object) -> None:
        """Count a bug that was caught; log its traceback at a bounded rate."""
        self._metrics.internal_errors.add()
        self._throttle.error("a bug, caught", what, exc_info=error or True, **fields)

    def _beside(self, what: str, look: Callable[[Any], None], facts: Sequence[Fact]) -> None:
        """Give facts to an observer; a bug in it is caught, so that it stops nobody else."""
        for fact in facts:
            try:
                look(fact)
            except Exception as error:
                self.bug(what, error)

    def _count(self, arrived: Arrived) -> None:
        sensors, taken, lost, duplicates, late, implausible = arrived
        if len(sensors) == 1:  # true of most facts, which need no Counter: it is slow
            labels = {self._metrics.sensor_label(sensors[0]): 1}
        else:
            labels = Counter(self._metrics.sensor_labels(sensors))
        for label, number in labels.items():
            for result, count in (("ok", taken), ("lost", lost), ("duplicate", duplicates), ("late", late)):
                if count:
                    self._metrics.frames.add(label, result, count=number * count)
        if implausible:
            self._metrics.implausible.add(count=implausible)

    def _changed(self, change: Changed) -> None:
        if change.what == "new":
            log.info("new sensor", sensor=change.sensor, source=str(Address(*change.source[:2])))
        else:
            self._throttle.warn(CHANGES[change.what], change.what, sensor=change.sensor)


def _answer(event: Gesture | Unknown | Cancelled, epoch: float, test: bool) -> dict[str, Any]:
    if isinstance(event, Cancelled):
        when, answer, confidence = time.time(), f"cancelled: {event.reason}", None
    else:
        answer = event.gesture if isinstance(event, Gesture) else "unknown"
        when, confidence = event.decided + epoch, round(event.confidence, 3)
    return {"time": when, "sensor": event.sensor, "answer": answer, "confidence": confidence, "test": test}
