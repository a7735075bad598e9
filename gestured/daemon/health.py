"""How the daemon is: its status, its greeting, and what /healthz and /readyz say."""

import secrets
import time

from gestured import __version__
from gestured.core import messages
from gestured.core.events import Cancelled, Event, Gesture, Status, Unknown
from gestured.daemon.pipeline import Pipeline
from gestured.ladder import Ladder

HANG_S = 2.0  # the loop counts as hanging after so long without a beat


class Health:
    """Read by the loop and by the HTTP thread. `beat` is set by the loop as long as it turns."""

    def __init__(self, pipeline: Pipeline, ladder: Ladder) -> None:
        self.pipeline, self.ladder = pipeline, ladder
        self.instance = secrets.token_hex(8)
        self.beat = time.monotonic()
        self.stopping = False
        self._models_failed = False

    def note(self, event: Event) -> None:
        """Remember whether the models can still answer."""
        if isinstance(event, Gesture | Unknown):
            self._models_failed = False
        elif isinstance(event, Cancelled) and event.reason == "model":
            self._models_failed = True

    def status(self, now: float) -> Status:
        """The sign of life at `now` (monotonic seconds)."""
        states = self.pipeline.states(now)
        if all(state == "stale" for state in states.values()):
            state = "no_data"
        else:
            state = "degraded" if self.ladder.degraded or self._models_failed else "ok"
        return Status(state, states, self.ladder.active, time.time())

    def hello(self) -> bytes:
        """The first line to a client."""
        sequences = {name: sensor.recognizer.sequence for name, sensor in self.pipeline.sensors.items()}
        return messages.hello_json(__version__, self.instance, self.ladder.active, self.pipeline.gestures, sequences)

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
            "model": self.ladder.active,
            "degraded": self.ladder.degraded,
            "sensors": self.pipeline.states(now),
        }
