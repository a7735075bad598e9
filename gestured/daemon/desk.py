"""What becomes of the hub's facts: events are published, other facts are counted, logged and compared."""

from collections.abc import Callable, Sequence
from typing import Any

from gestured.core.address import Address
from gestured.core.facts import Arrived, Changed, Decided, Dropped, Fact, Fault, Taken
from gestured.daemon.log import Throttle, log
from gestured.daemon.metrics import Metrics
from gestured.daemon.own import OwnGestures
from gestured.daemon.publisher import Publisher
from gestured.daemon.shift import Shift
from gestured.daemon.views import Views

CHANGES = {"silent": "sensor is silent", "restarted": "sensor restarted"}


class Desk:
    """Takes the hub's facts, and what its reader has dropped."""

    def __init__(self, metrics: Metrics, publisher: Publisher, shift: Shift, own: OwnGestures, views: Views) -> None:
        self._metrics, self._publisher, self._own, self._views = metrics, publisher, own, views
        self.shift = shift  # how the segments differ from the training data of the model that answers
        self._throttle = Throttle()

    def take(self, facts: Sequence[Fact]) -> None:
        """Publish the events among the facts, then let those look on who act on none."""
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
                self._publisher.publish(fact)
        if decided:
            self._beside("in what compares segments with the training's", self.shift.see, decided)
        if self._own.enrolling:
            self._beside("in what judges an example", self._own.see, facts)
        self._views.see(facts)

    def drop(self, reason: str, count: int = 1, **fields: object) -> None:
        """Count packets that were dropped; log the reason at a bounded rate."""
        self._metrics.dropped.add(reason, count=count)
        self._throttle.warn("dropped", reason, **{name: value for name, value in fields.items() if value})

    def muted(self, senders: Sequence[tuple[str, int] | str]) -> None:
        """Say at a bounded rate that these senders of a flood are not heard for a while."""
        names = [sender if isinstance(sender, str) else str(Address(*sender[:2])) for sender in senders]
        self._throttle.warn("senders of a flood are not heard for some seconds", "muted", senders=names)

    def bug(self, what: str, error: BaseException | None = None, **fields: object) -> None:
        """Count a bug that was caught; log its traceback at a bounded rate."""
        self._metrics.internal_errors.add()
        self._throttle.error("a bug, caught", what, exc_info=error or True, **fields)

    def _beside(self, what: str, look: Callable[[Any], None], facts: Sequence[Fact]) -> None:
        """Show facts to one that looks on. A bug in it is caught, so that it stops nobody else."""
        for fact in facts:
            try:
                look(fact)
            except Exception as error:
                self.bug(what, error)

    def _count(self, arrived: Arrived) -> None:
        frames, label = self._metrics.frames, self._metrics.sensor_label(arrived.sensor)
        if arrived.taken:
            frames.add(label, "ok", count=arrived.taken)
        if arrived.lost:
            frames.add(label, "lost", count=arrived.lost)
        if arrived.duplicates:
            frames.add(label, "duplicate", count=arrived.duplicates)
        if arrived.late:
            frames.add(label, "late", count=arrived.late)
        if arrived.implausible:
            self._metrics.implausible.add(count=arrived.implausible)

    def _changed(self, change: Changed) -> None:
        if change.what == "new":
            log.info("new sensor", sensor=change.sensor, source=str(Address(*change.source[:2])))
        else:
            self._throttle.warn(CHANGES[change.what], change.what, sensor=change.sensor)
