"""The operating points of a model: how readily it speaks, and what it misses and says falsely then."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

Strictness = Literal["eager", "normal", "strict"]
STRICTNESS: tuple[Strictness, ...] = get_args(Strictness)
USUAL: Strictness = "normal"


@dataclass(frozen=True, slots=True)
class Point:
    """What one strictness is to a model, and what it cost where that was measured."""

    thresholds: Mapping[str, float]  # by gesture, each of the model's: confidence from which it is published
    provisional: float | None  # least confidence of a provisional event, besides its `Certainty`; None for none
    missed: float  # share of the gestures that were meant
    false_per_hour: float
    hours: float  # that were judged


@dataclass(frozen=True, slots=True)
class OperatingPoints:
    """A point for each strictness, and the curve that they lie on."""

    points: Mapping[str, Point]  # by strictness
    # Threshold of all gestures alike, share missed, false an hour; thresholds rise.
    curve: tuple[tuple[float, float, float], ...]
