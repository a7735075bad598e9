"""Who looks on while models answer: the shift, and a candidate in the shadow.

Looking on takes some tenths of a millisecond (the shift); a shadow's inference is another process's business. It comes
after the answer went out, and cannot change or prevent it.
"""

from gestured.core.errors import ModelError
from gestured.core.facts import Decided
from gestured.daemon.shadow import Shadow
from gestured.daemon.shift import Shift
from gestured.model.ladder import Ladder
from gestured.model.process import ModelProcess


class Watch:
    """Sees each segment that was decided."""

    def __init__(self, ladder: Ladder) -> None:
        self.shadow: Shadow | None = None
        self.follow(ladder)

    def follow(self, ladder: Ladder) -> None:
        """Look at other models from now on; a shadow that does not know their gestures ends."""
        self._ladder = ladder
        self.shift = Shift(ladder.model.metadata.quantiles, ladder.model.metadata.window)
        if self.shadow is not None and self.shadow.candidate.gestures != ladder.gestures:
            self.shadow.close()
            self.shadow = None

    def see(self, decided: Decided) -> None:
        """Look at a segment, once its event is out."""
        self.shift.see(decided.segment, decided.scores, decided.known)
        if self.shadow is not None:
            self.shadow.see(decided.segment, decided.scores)

    def compare(self, candidate: ModelProcess) -> Shadow:
        """Run a candidate beside the ladder from now on. Raises ModelError for one that knows other gestures."""
        if candidate.gestures != self._ladder.gestures:
            candidate.close()
            raise ModelError(
                f"{candidate.name}: expected the gestures of {self._ladder.name} in the same order "
                f"({', '.join(self._ladder.gestures)}), found {', '.join(candidate.gestures)}"
            )
        if self.shadow is not None:
            self.shadow.close()
        self.shadow = Shadow(candidate)
        return self.shadow
