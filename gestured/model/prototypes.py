"""Prototypes: what a few examples say of a gesture of the user's own, in the space of a model's embedding.

How much two performances of one person differ, and how far apart two gestures lie, is learned in the lab from many
people (`Space`, a model's metadata `own`). A prototype is the mean of its examples, drawn towards the space's mean if
they are few. The nearness of a segment to it is a log likelihood ratio: that gesture against any movement at all.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.classifier import NEAR, Match
from gestured.core.own import EXAMPLES
from gestured.model.file import packed, unpacked

DIMENSIONS = 512  # the most of a space or an embedding
SUREST = 40.0  # log odds beyond which a confidence is 0 or 1 in any case; far beyond them `exp` would overflow

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """Where embeddings of one model are compared: K directions, in which one person's repetitions spread by 1."""

    mean: Array  # (E,) the mean of embeddings
    directions: Array  # (K, E) the map from an embedding to a place
    between: Array  # (K,) variance between gestures, in units of the variance within one
    built_in: Array  # (2, G, K) mean and variance of each of the model's gestures, over people
    thresholds: tuple[float, ...]  # nearness that a gesture of 1, 2 ... EXAMPLES examples asks for
    slope: float  # slope of a confidence's log odds over the nearness
    margin: float  # a segment is taken from the model's gestures if it is nearer to an own one by so much

    def place(self, embedding: NDArray[np.floating[Any]]) -> Array:
        """(..., E) embeddings -> (..., K) places."""
        return np.asarray((embedding - self.mean) @ self.directions.T)

    def built_in_nearness(self, place: Array) -> Array:
        """How near a place (..., K) is to the nearest of the model's gestures, on the scale of `Prototype.nearness`."""
        mean, variance = self.built_in
        return np.asarray(_ratio(place[..., np.newaxis, :], mean, variance, self.between).max(axis=-1))

    def claimed(self, place: Array) -> bool:
        """Whether a gesture performed at a place (K,) is too near to the model's gestures to be taken from them."""
        alone = Prototype.of(self, place[np.newaxis])
        usual = alone.nearness(alone.mean) - len(self.between) / 2  # a performance is 1 away in each direction
        return bool(usual - self.built_in_nearness(place) < self.margin)

    def to_json(self) -> str:
        """The space as JSON, for a model's metadata."""
        return json.dumps(
            {
                "mean": packed(self.mean),
                "directions": packed(self.directions),
                "between": packed(self.between),
                "built_in": packed(self.built_in),
                "thresholds": [round(value, 4) for value in self.thresholds],
                "slope": round(self.slope, 4),
                "margin": round(self.margin, 4),
            }
        )

    @classmethod
    def from_json(cls, told: Mapping[str, Any], gestures: int) -> "Space":
        """The space that `to_json` wrote, of a model with so many `gestures`. Raises ValueError for anything else."""
        try:
            mean, between = _values(told, "mean"), _values(told, "between")
            inner, outer = len(between), len(mean)
            if not (0 < inner <= DIMENSIONS and 0 < outer <= DIMENSIONS):
                raise ValueError
            directions = _values(told, "directions").reshape(inner, outer)
            built_in = _values(told, "built_in").reshape(2, gestures, inner)
            thresholds = tuple(float(value) for value in told["thresholds"])
            slope, margin = float(told["slope"]), float(told["margin"])
        except (KeyError, TypeError, ValueError, OverflowError):
            raise ValueError("expected mean, directions, between, built_in, thresholds, slope and margin") from None
        if len(thresholds) != EXAMPLES or not all(map(math.isfinite, (*thresholds, slope, margin))) or slope <= 0:
            raise ValueError(f"expected {EXAMPLES} thresholds, a margin and a slope above 0, all finite")
        if between.min() < 0 or built_in[1].min() <= 0:
            raise ValueError("expected variances above 0")
        return cls(mean, directions, between, built_in, thresholds, slope, margin)


@dataclass(frozen=True, slots=True, eq=False)
class Prototype:
    """One gesture of the user's own in a space."""

    space: Space
    mean: Array  # (K,) the place at which a performance is expected
    variance: Array  # (K,) variance of a performance around that place
    threshold: float  # nearness from which a segment is this gesture

    @classmethod
    def of(cls, space: Space, places: Array) -> "Prototype":
        """The prototype of 1 to EXAMPLES examples, by their (n, K) places."""
        n = len(places)
        sure = space.between * n / (space.between * n + 1.0)  # how far the examples are believed, 0 to 1
        mean = sure * places.mean(axis=0)
        return cls(space, mean, 1.0 + sure / n, space.thresholds[n - 1])

    def nearness(self, place: Array) -> Array:
        """The log of the likelihood ratio of places (..., K): this gesture against any movement."""
        return _ratio(place, self.mean, self.variance, self.space.between)

    def confidence(self, place: Array) -> float:
        """The confidence, 0 to 1, that a place (K,) is this gesture; NEAR at the threshold."""
        ahead = self.space.slope * (self.nearness(place) - self.threshold)
        return float(1.0 / (1.0 + np.exp(-np.clip(ahead, -SUREST, SUREST))))


def nearest(space: Space, prototypes: Mapping[str, Prototype], place: Array) -> Match | None:
    """The best match of a place (K,), None if there are no prototypes."""
    if not prototypes:
        return None
    each = tuple(prototypes.values())
    mean, variance = np.stack([one.mean for one in each]), np.stack([one.variance for one in each])
    near = _ratio(place, mean, variance, space.between)
    best = int((near - [one.threshold for one in each]).argmax())
    nearer = bool(near[best] - space.built_in_nearness(place) >= space.margin)
    return Match(tuple(prototypes)[best], each[best].confidence(place), nearer)


def _ratio(place: Array, mean: Array, variance: Array, between: Array) -> Array:
    """Log of N(place; mean, variance) over N(place; 0, 1 + between), summed over the last axis."""
    whole = 1.0 + between
    terms = place**2 / whole - (place - mean) ** 2 / variance + np.log(whole / variance)
    return np.asarray(0.5 * terms.sum(axis=-1))


def _values(told: Mapping[str, Any], key: str) -> Array:
    return unpacked(told[key]).astype(np.float64)


def clashes(prototypes: Mapping[str, Prototype], examples: Mapping[str, Array]) -> list[tuple[str, str]]:
    """Pairs of gestures such that one of the first's examples, by its (n, K) places, would be taken for the second."""
    return [
        (name, other)
        for name, places in examples.items()
        for other, prototype in prototypes.items()
        if other != name and any(prototype.confidence(place) >= NEAR for place in places)
    ]
