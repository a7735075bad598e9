"""The classifier's Protocol, for a model or a ladder of models, and the scores that it gives."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gestured.core.frames import Segment
from gestured.core.points import Certainty, Point

NEAR = 0.5  # confidence from which a segment is a gesture of the user's own, if nothing else is set


@dataclass(frozen=True, slots=True)
class Match:
    """The gesture of the user's own that a segment is nearest to."""

    name: str
    confidence: float
    nearer: bool  # whether it is so much nearer than the model's gestures that it may take a segment from them


@dataclass(frozen=True, slots=True)
class Scores:
    """What a classifier says of a segment."""

    values: NDArray[np.float32]  # (G,) probabilities if it is one of the gestures, in the classifier's order
    unknown: float  # probability that it is none of them
    model: str  # name of the model that answered
    degraded: bool = False  # whether a fallback answered
    threshold: float = 0.5  # confidence from which it is published without `points`, or on an armed sensor
    took_s: float = 0.0  # run time
    own: Match | None = None  # the nearest gesture of the user's own, if there are any
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
        """How sure the classifier must be of a contact that is not over; None if it was not made for that."""
        return None

    def classify(self, segment: Segment) -> Scores:
        """Score one segment. Raises ModelError if that fails."""
        ...

    def preview(self, segment: Segment) -> Scores | None:
        """Score the beginning of a segment, or a segment in another context; None if that fails.

        No later answer may depend on it. Beginnings are scored only if there is a `certainty`.
        """
        return None
