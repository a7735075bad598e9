"""The classifier that the daemon's recognizers use: a ladder, and who looks on while it answers.

Looking on takes some tenths of a millisecond (the shift) or one more inference (a shadow), before the answer goes out.
"""

from gestured.core.errors import ModelError
from gestured.core.frames import Segment
from gestured.core.recognizer import Scores
from gestured.daemon.log import Throttle
from gestured.daemon.shadow import UNKNOWN, Shadow, answer
from gestured.daemon.shift import Shift, measured
from gestured.ladder import Ladder
from gestured.models import Model


class Watched:
    """A `Classifier`. What looks on comes after the answer, and cannot change or prevent it."""

    def __init__(self, ladder: Ladder) -> None:
        self.ladder = ladder
        self.gestures = ladder.gestures
        model = ladder.model
        self._window = model.metadata.window if isinstance(model, Model) else None
        self.shift = Shift(model.metadata.quantiles if isinstance(model, Model) else {})
        self.shadow: Shadow | None = None
        self._throttle = Throttle()

    def classify(self, segment: Segment) -> Scores:
        """The ladder's answer; raises ModelError where it has none."""
        scores = self.ladder.classify(segment)
        try:
            self._look_on(segment, scores)
        except Exception:
            self._throttle.error("a bug, caught", "in what looks on while models answer")
        return scores

    def _look_on(self, segment: Segment, scores: Scores) -> None:
        if self._window is not None and self.shift.ranges and answer(self.ladder, scores)[0] != UNKNOWN:
            self.shift.add(measured(segment, self._window))
        if self.shadow is not None:
            self.shadow.see(segment, scores)

    def compare(self, model: Model) -> Shadow:
        """Run a candidate beside the ladder from now on. Raises ModelError for one that knows other gestures."""
        if model.gestures != self.gestures:
            raise ModelError(
                f"{model.name}: expected the gestures of {self.ladder.name} in the same order "
                f"({', '.join(self.gestures)}), found {', '.join(model.gestures)}"
            )
        self.shadow = Shadow(model, model.name)
        return self.shadow
