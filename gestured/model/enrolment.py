"""An enrolment: somebody performs a new gesture a few times, and each example is judged at once."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gestured.core.classifier import NEAR
from gestured.core.cutter import bearable_s
from gestured.core.events import Cancelled
from gestured.core.frames import Segment
from gestured.core.own import Example
from gestured.model.model import Model
from gestured.model.own import Own, placed
from gestured.model.prototypes import Prototype, Space

SHORTEST_S = 0.15  # the shortest example; a shorter contact is a tap, whatever was meant
FEWEST = 3  # the fewest touched frames of an example; fewer show no movement


class Examiner:
    """A judge of an enrolment's examples, by one model: it says in words what speaks against an example, or None."""

    def __init__(self, model: Model, space: Space, own: Own, in_use: Collection[str]) -> None:
        """`own` are the user's gestures so far, `in_use` the model's gestures that are in use."""
        self._model, self._space, self._own, self._in_use = model, space, own, in_use

    def example(self, segment: Segment) -> Example | None:
        """The example of a segment; None for a segment that is too long, or not finite."""
        return Example.of(segment, self._model.metadata.window)

    def same_as(self, example: Example) -> str | None:
        """The gesture that an example would be taken for, and its confidence, in words; None if there is none."""
        taken = placed(self._model, self._space, example).taken
        if taken is not None and taken[0] in self._in_use:
            return f"{taken[0]} ({taken[1]:.2f})"
        match = self._own.nearest_to(self._model, example)
        return None if match is None or match.confidence < NEAR else f"{match.name} ({match.confidence:.2f})"

    def unlike(self, example: Example, kept: Sequence[Example]) -> str | None:
        """The confidence that an example is the gesture of those kept, in words, if that is too low; else None."""
        near, *others = (placed(self._model, self._space, one).place for one in (example, *kept))
        confidence = Prototype.of(self._space, np.stack(others)).confidence(near)
        return None if confidence >= NEAR else f"{confidence:.2f}, expected {NEAR:.2f}"


@dataclass
class Enrolment:
    """The enrolment of one gesture. `see` returns what to tell the user about each attempt."""

    name: str
    sensor: str
    wanted: int
    judge: Examiner
    kept: list[Example] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        """Whether there are as many examples as were asked for."""
        return len(self.kept) >= self.wanted

    def see(self, what: Segment | Cancelled) -> dict[str, Any]:
        """Judge an attempt on the sensor: the example is kept, or there is a reason why not."""
        reason = self._fault(what)
        return {"example": len(self.kept) + (reason is not None), "kept": reason is None, "reason": reason}

    def _fault(self, what: Segment | Cancelled) -> str | None:
        if isinstance(what, Cancelled):
            return CANCELLED.get(what.reason, f"the contact was cancelled ({what.reason}); do it again")
        if what.last - what.first + 1 < FEWEST or what.offset - what.onset < SHORTEST_S:
            return f"too short: a gesture of your own takes {SHORTEST_S:g} s and {FEWEST} frames at least"
        steps = np.diff(what.times[what.first : what.last + 1])
        if steps.max() > bearable_s(float(np.median(steps))):
            return "frames were lost in the middle of it; do it again"
        example = self.judge.example(what)
        if example is None:
            return "too long: make it shorter"
        if (same := self.judge.same_as(example)) is not None:
            return f"the same as {same}: change its shape, its direction, or the number of fingers"
        if self.kept and (unlike := self.judge.unlike(example, self.kept)) is not None:
            return f"not like the others ({unlike}): do it as you did it first"
        self.kept.append(example)
        return None


CANCELLED = {
    "held": "the contact was not over: lift the finger at the end of the gesture",
    "silence": "the sensor fell silent during the contact; do it again",
    "glitch": "too short: that was no finger",
    "stuck": "the contact did not look like a finger; do it again",
}
