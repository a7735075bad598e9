"""Distribution shift: do the gestures of this deployment look like those that the model was trained on?

The model's metadata say between which values the middle 98 % of its training gestures lay, for strength, duration
and area. Of the last LAST gestures we count how many lie outside. In training it is 2 %; one person's are no sample
of all people, so nothing is said below UNLIKELY. (A test of the whole distribution, such as the population stability
index, would call every single driver a shift: one hand varies less than a population's. The range does not.)
Memory is LAST numbers a quantity.
"""

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from gestured.core.frames import Segment
from gestured.core.window import Window

LAST = 100  # gestures
LEAST = 20  # before which nothing is said
UNLIKELY = 0.2  # share outside; with 2 % expected, 4 of 20 come by chance once in 1700 times (binomial)
ACTIVE, COVERED = 0.15, 0.2  # of the segment's peak, as the lab measures its training data
QUANTITIES = ("strength", "duration_s", "area")


class Shift:
    """What came, held against a model's `quantiles` (metadata); knows nothing where they say nothing."""

    def __init__(self, quantiles: Mapping[str, Any]) -> None:
        self.ranges = {name: found for name in QUANTITIES if (found := _range(quantiles, name)) is not None}
        self._outside: dict[str, deque[bool]] = {name: deque(maxlen=LAST) for name in self.ranges}

    def add(self, seen: Mapping[str, float]) -> None:
        """One gesture's quantities, as `measured` gives them."""
        for name, (low, high) in self.ranges.items():
            self._outside[name].append(not low <= seen[name] <= high)

    @property
    def count(self) -> int:
        """Gestures that are counted now."""
        return max((len(outside) for outside in self._outside.values()), default=0)

    def shares(self) -> dict[str, float]:
        """Share outside the training range for each quantity; empty before there were LEAST gestures."""
        return {
            name: sum(tuple(outside)) / len(outside) for name, outside in self._outside.items() if len(outside) >= LEAST
        }

    def unlike(self) -> list[str]:
        """The quantities that do not look like the training data."""
        return [name for name, share in self.shares().items() if share >= UNLIKELY]


def measured(segment: Segment, window: Window) -> dict[str, float]:
    """Strength (peak over noise), duration_s and area (share of the grid) of a segment, as in the lab's `quantiles`."""
    touched = segment.frames[segment.first : segment.last + 1]
    frames = window.apply(segment)
    active = frames[frames.max(axis=(1, 2)) >= ACTIVE] if len(frames) else frames
    return {
        "strength": float(touched.max()) / max(segment.noise, 1e-30),
        "duration_s": len(active) / window.rate_hz,
        "area": float((active >= COVERED).mean()) if len(active) else 0.0,
    }


def _range(quantiles: Mapping[str, Any], name: str) -> tuple[float, float] | None:
    """(1 %, 99 %) where the metadata hold them; a model of somebody's own may say less, or nonsense."""
    try:
        at, values = np.asarray(quantiles["at"], float), np.asarray(quantiles[name], float)
        low, high = (float(values[np.flatnonzero(at == q)[0]]) for q in (0.01, 0.99))
    except (KeyError, ValueError, IndexError, TypeError):
        return None
    return (low, high) if low <= high else None
