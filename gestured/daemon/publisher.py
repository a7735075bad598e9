"""Where events leave the daemon: every sink gets each of them, then it is counted and remembered."""

import time
from collections import deque
from typing import Any

from gestured.core import messages
from gestured.core.events import Cancelled, Event, Gesture, Status, Touch, Unknown
from gestured.daemon.log import Throttle, log
from gestured.daemon.metrics import Metrics
from gestured.daemon.sinks import Sink

RECENT = 10  # answers that `gesturectl status` shows


class Publisher:
    """Gives events to sinks; `sinks` may be replaced between two events."""

    def __init__(self, metrics: Metrics, sinks: tuple[Sink, ...]) -> None:
        self.sinks = sinks
        self.models_failed = False  # whether no model could answer the last segment
        self._metrics, self._throttle = metrics, Throttle()
        self._recent: deque[dict[str, Any]] = deque(maxlen=RECENT)

    def publish(self, event: Event, *, test: bool = False) -> None:
        """Give an event to every sink, then count it. A `test` was made up, so it counts as no model's answer."""
        epoch = time.time() - time.monotonic()
        for sink in self.sinks:
            try:
                sink.publish(event, epoch, test=test)
            except Exception:  # a bug in one sink must not keep the event from the others
                self._metrics.internal_errors.add()
                self._throttle.error("a bug in a sink", type(sink).__name__)
        if isinstance(event, Touch):
            return  # up to 60 a second, which say nothing of what was answered
        if not test:
            self._metrics.event(event)
            if isinstance(event, Gesture | Unknown):
                self.models_failed = False
            elif isinstance(event, Cancelled) and event.reason == "model":
                self.models_failed = True
        elif isinstance(event, Gesture):
            self._metrics.tests.add()
        if isinstance(event, Gesture | Unknown | Cancelled):
            self._recent.append(_answer(event, epoch, test))
        if not isinstance(event, Status):
            name = getattr(event, "gesture", None)
            log.debug(messages.event_type(event), sensor=event.sensor, id=getattr(event, "id", None), gesture=name)

    def recent(self) -> tuple[dict[str, Any], ...]:
        """The last RECENT answers as `gesturectl status` shows them, oldest first."""
        return tuple(self._recent)


def _answer(event: Gesture | Unknown | Cancelled, epoch: float, test: bool) -> dict[str, Any]:
    if isinstance(event, Cancelled):
        when, answer, confidence = time.time(), f"cancelled: {event.reason}", None
    else:
        answer = event.gesture if isinstance(event, Gesture) else "unknown"
        when, confidence = event.decided + epoch, round(event.confidence, 3)
    return {"time": when, "sensor": event.sensor, "answer": answer, "confidence": confidence, "test": test}
