"""How sure a model must be of a contact before it is over."""

from collections.abc import Mapping
from dataclasses import dataclass, field

Needed = tuple[float | None, ...]  # confidences, one for each stretch of elapsed time; None is never


@dataclass(frozen=True, slots=True)
class Certainty:
    """How sure a model must be of a contact that is not over: confidences by the time since its onset.

    A certainty is part of the model, stored in its metadata as `provisional`.
    """

    in_a_row: int  # frames that must be sure enough of the same gesture, one after the other
    elapsed_s: tuple[float, ...]  # where stretches of time begin; the first at 0
    thresholds: Needed  # of gestures that have none of their own in `gestures`
    gestures: Mapping[str, Needed] = field(default_factory=dict)  # by gesture: what it needs in place of `thresholds`
    tap: float | None = None  # confidence that one tap needs once the finger has left; None is never

    def needed(self, gesture: str, elapsed_s: float) -> float | None:
        """The confidence that a gesture needs so long after the onset, None where it is never enough."""
        stretch = sum(begin <= elapsed_s for begin in self.elapsed_s[1:])
        return self.gestures.get(gesture, self.thresholds)[stretch]
