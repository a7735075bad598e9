"""Operating points and certainty: how sure a model must be of a contact that is over, and of one that is not."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

Strictness = Literal["eager", "normal", "strict"]
STRICTNESS: tuple[Strictness, ...] = get_args(Strictness)
USUAL: Strictness = "normal"
Curve = tuple[tuple[float, float, float], ...]  # rows of one threshold for all gestures, share missed, false an hour
Needed = tuple[float | None, ...]  # confidences, one for each stretch of elapsed time; None if none is enough


@dataclass(frozen=True, slots=True)
class Point:
    """The operating point of a model for one strictness, and what it cost when it was measured."""

    thresholds: Mapping[str, float]  # by gesture, for each of the model's: confidence from which it is published
    provisional: float | None  # least confidence of a provisional event, besides its `Certainty`; None if there is none
    missed: float  # share of the gestures performed that were missed
    false_per_hour: float
    hours: float  # length of what was judged


@dataclass(frozen=True, slots=True)
class Certainty:
    """How sure a model must be of a contact that is not over: confidences by the time since its onset.

    A certainty is part of the model, stored in its metadata as `provisional`.
    """

    in_a_row: int  # frames that must be sure enough of the same gesture, one after the other
    elapsed_s: tuple[float, ...]  # where stretches of time begin; the first at 0
    thresholds: Needed  # of gestures that have none of their own in `gestures`
    gestures: Mapping[str, Needed] = field(default_factory=dict)  # by gesture: what it needs in place of `thresholds`
    tap: float | None = None  # confidence that one tap needs once the finger has left; None if none is enough

    def needed(self, gesture: str, elapsed_s: float) -> float | None:
        """The confidence that a gesture needs so long after the onset; None if none is enough."""
        stretch = sum(begin <= elapsed_s for begin in self.elapsed_s[1:])
        return self.gestures.get(gesture, self.thresholds)[stretch]
