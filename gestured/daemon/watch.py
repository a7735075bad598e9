"""The classifier that the daemon's recognizers use: a ladder, and who looks on once it has answered.

Looking on takes some tenths of a millisecond (the shift); a shadow's inference is another process's business. It comes
after the answer went out, and cannot change or prevent it.
"""

from gestured.core.errors import ModelError
from gestured.core.frames import Segment
from gestured.core.recognizer import Scores
from gestured.daemon.log import Throttle
from gestured.daemon.shadow import Shadow
from gestured.daemon.shift import Shift
from gestured.model.ladder import Ladder
from gestured.model.model import Model
from gestured.model.process import ModelProcess


class Watched:
    """A `Classifier`, and what is to be looked at when there is time."""

    def __init__(self, ladder: Ladder) -> None:
        self.ladder = ladder
        self.gestures = ladder.gestures
        model = ladder.model
        self.shift = Shift(model.metadata.quantiles, model.metadata.window) if isinstance(model, Model) else Shift({})
        self.shadow: Shadow | None = None
        self._decided: list[tuple[Segment, Scores, bool]] = []
        self._throttle = Throttle()

    def classify(self, segment: Segment) -> Scores:
        """The ladder's answer; raises ModelError where it has none."""
        return self.ladder.classify(segment)

    def note(self, segment: Segment, scores: Scores, known: bool) -> None:
        """A segment was decided by these scores, as a gesture or not: `look_on` will look at it."""
        self._decided.append((segment, scores, known))

    def look_on(self) -> None:
        """Look at what was decided; to be called when its events are out."""
        decided, self._decided = self._decided, []
        for segment, scores, known in decided:
            try:
                self.shift.see(segment, scores, known)
                if self.shadow is not None:
                    self.shadow.see(segment, scores)
            except Exception:
                self._throttle.error("a bug, caught", "in what looks on while models answer")

    def compare(self, candidate: ModelProcess) -> Shadow:
        """Run a candidate beside the ladder from now on. Raises ModelError for one that knows other gestures."""
        if candidate.gestures != self.gestures:
            candidate.close()
            raise ModelError(
                f"{candidate.name}: expected the gestures of {self.ladder.name} in the same order "
                f"({', '.join(self.gestures)}), found {', '.join(candidate.gestures)}"
            )
        if self.shadow is not None:
            self.shadow.close()
        self.shadow = Shadow(candidate)
        return self.shadow
