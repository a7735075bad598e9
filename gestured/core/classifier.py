"""The Protocol of whatever scores segments (a model, or a ladder of models), and the scores that it gives."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gestured.core.frames import Segment
from gestured.core.points import Certainty, Point

NEAR = 0.5  # confidence from which a segment is a gesture of the user's own, where nothing else is set


@dataclass(frozen=True, slots=True)
class Match:
    """The gesture of the user's own that a segment is nearest to."""

    name: str
    confidence: float
    nearer: bool  # than any of the model's gestures, by so much that it may take a segment from them


@dataclass(frozen=True, slots=True)
class Scores:
    """What a classifier says of a segment."""

    values: NDArray[np.float32]  # (G,) probabilities given that it is one of the gestures, in the classifier's order
    unknown: float  # probability that it is none of them
    model: str
    degraded: bool = False  # whether a fallback answered
    threshold: float = 0.5  # confidence from which it is published where there are no `points`, or a gesture has armed
    took_s: float = 0.0  # s that the model ran
    own: Match | None = None  # the nearest gesture of the user's own, where there are any
    points: Mapping[str, Point] | None = None  # operating points of the model, by strictness

    @property
    def confidence(self) -> float:
        """The confidence of the best gesture, 0 to 1."""
        return float(self.values.max()) * (1.0 - self.unknown)


class Classifier(Protocol):
    """Anything that scores segments: a model, or a ladder of them."""

    gestures: tuple[str, ...]

    @property
    def certainty(self) -> Certainty | None:
        """How sure the classifier must be of a contact that is not over; None where it was not made for that."""
        return None

    def classify(self, segment: Segment) -> Scores:
        """Score one segment; raises ModelError where it cannot."""
        ...

    def preview(self, segment: Segment) -> Scores | None:
        """Score the beginning of a segment, None where that fails: no later answer may depend on it.

        `preview` is called only where there is a `certainty`.
        """
        return None
