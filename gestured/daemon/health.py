"""How the daemon is: its status, its greeting, and what /healthz and /readyz say."""

import secrets
import time

from gestured import __version__
from gestured.core import messages
from gestured.core.events import Cancelled, Event, Gesture, Status, Unknown
from gestured.daemon.pipeline import SILENT, Pipeline

TICK_S = 0.25  # the loop comes round at least so often
HANG_S = 2.0  # the loop counts as hanging after so long without a beat


class Health:
    """Read by the loop and by the HTTP thread. `beat` is set by the loop as long as it turns."""

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline
        self.instance = secrets.token_hex(8)
        self.beat = time.monotonic()
        self._lag = 0.0
        self.stopping = False
        self._models_failed = False

    def note(self, event: Event) -> None:
        """Remember whether the models can still answer."""
        if isinstance(event, Gesture | Unknown):
            self._models_failed = False
        elif isinstance(event, Cancelled) and event.reason == "model":
            self._models_failed = True

    def woke(self, late_s: float) -> None:
        """The loop came round, `late_s` after it wanted to."""
        self.beat = time.monotonic()
        self._lag = max(late_s, 0.95 * self._lag)

    @property
    def lag_s(self) -> float:
        """How late the loop is: its worst of late (halved in about 4 s), and while it hangs, how long it does."""
        return max(self._lag, time.monotonic() - self.beat - TICK_S)

    def status(self, now: float) -> Status:
        """The sign of life at `now` (monotonic seconds)."""
        states = self.pipeline.states(now)
        if all(state in SILENT for state in states.values()):
            state = "no_data"
        else:
            state = "degraded" if self.pipeline.watched.ladder.degraded or self._models_failed else "ok"
        return Status(state, states, self.pipeline.watched.ladder.active, time.time())

    def hello(self) -> bytes:
        """The first line to a client."""
        heard = {name: sensor.recognizer.sequence for name, sensor in self.pipeline.sensors.items()}
        given = {name: sequence for name, (sequence, _) in self.pipeline.given.items()}
        sequences = given | heard
        model, gestures = self.pipeline.watched.ladder.active, self.pipeline.gestures
        return messages.hello_json(__version__, self.instance, model, gestures, sequences)

    def healthz(self) -> tuple[int, dict[str, object]]:
        """Whether the loop turns."""
        age = time.monotonic() - self.beat
        return 200 if age < HANG_S else 503, {"healthy": age < HANG_S, "loop_age_s": round(age, 3)}

    def readyz(self) -> tuple[int, dict[str, object]]:
        """Whether frames that come now would be answered, and why not."""
        now = time.monotonic()
        reasons = [
            reason
            for failed, reason in (
                (now - self.beat >= HANG_S, "the event loop hangs"),
                (self.stopping, "the daemon is stopping"),
                (self._models_failed, "no model could classify the last segment"),
            )
            if failed
        ]
        return 503 if reasons else 200, {
            "ready": not reasons,
            "reason": "; ".join(reasons) or None,
            "state": self.status(now).state,
            "loop_lag_s": round(self.lag_s, 3),
            "shift": self.pipeline.watched.shift.unlike(),
            "model": self.pipeline.watched.ladder.active,
            "degraded": self.pipeline.watched.ladder.degraded,
            "sensors": self.pipeline.states(now),
        }
