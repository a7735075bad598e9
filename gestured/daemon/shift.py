"""Distribution shift: whether the gestures of this deployment look like those that the model was trained on.

A model's metadata give the range of the middle 98 % of its training gestures, for each of `measures` and for the
strength, and the quantiles of its confidence for people whom it had not seen. Of the last LAST gestures we count how
many lie outside of a range, or below the 1 % quantile of the confidence. By chance these are 2 % (1 % for the
confidence), but one person is no sample of all people, so only a share from UNLIKELY on is a shift. (A test of the
whole distribution, such as the population stability index, would call every single driver a shift, since one hand
varies less than those of a population.) The share of unknown segments is told as well, but is no shift however large it
is: in everyday life most touches are no gestures.
"""

import math
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from gestured.core.facts import Decided
from gestured.core.frames import SMALLEST, Segment
from gestured.core.window import Window
from gestured.model.features import MEASURES, measures
from gestured.model.model import Model

LAST = 100  # gestures
LEAST_GESTURES = 20  # the fewest gestures from which a shift is told
UNLIKELY = 0.2  # share outside from which it is a shift; with 2 % expected, 4 of 20 come by chance once in 1700 times
QUANTITIES = ("strength", *MEASURES, "confidence")
UNKNOWN = "unknown"


class Shift:
    """The last gestures, compared with a model's `quantiles` (metadata), as far as these have the quantities."""

    def __init__(self, quantiles: Mapping[str, Any], window: Window) -> None:
        self._window = window
        self.ranges = {name: found for name in QUANTITIES if (found := _range(quantiles, name)) is not None}
        names = [*self.ranges, UNKNOWN] if self.ranges else []
        self._outside: dict[str, deque[bool]] = {name: deque(maxlen=LAST) for name in names}

    @classmethod
    def of(cls, model: Model) -> "Shift":
        """A comparison of the gestures from now on with the `quantiles` of a model."""
        return cls(model.metadata.quantiles, model.metadata.window)

    def see(self, decided: Decided) -> None:
        """Take a segment that was decided, unless a fallback did, since the quantiles are another model's."""
        if not self.ranges or decided.scores.degraded:
            return
        self._outside[UNKNOWN].append(not decided.known)
        if decided.known:
            self.add(measured(decided.segment, self._window) | {"confidence": decided.scores.confidence})

    def add(self, seen: Mapping[str, float]) -> None:
        """Take the quantities of one gesture."""
        for name, (low, high) in self.ranges.items():
            self._outside[name].append(not low <= seen[name] <= high)

    @property
    def count(self) -> int:
        """How many gestures the shares are made from."""
        return max((len(self._outside[name]) for name in self.ranges), default=0)

    def shares(self) -> dict[str, float]:
        """By quantity, the share outside the training range, and that of `unknown`, from LEAST_GESTURES on."""
        return {
            name: sum(tuple(outside)) / len(outside)
            for name, outside in self._outside.items()
            if len(outside) >= LEAST_GESTURES
        }

    def unlike(self) -> list[str]:
        """The quantities that do not look like the training data."""
        return [name for name, share in self.shares().items() if share >= UNLIKELY and name != UNKNOWN]


def measured(segment: Segment, window: Window) -> dict[str, float]:
    """Strength (peak over the sensor's noise) of a segment, and its `measures`."""
    touched = segment.frames[segment.first : segment.last + 1]
    strength = float(touched.max()) / max(segment.noise, SMALLEST)
    return {"strength": strength} | measures(window.apply(segment), window.rate_hz)


def _range(quantiles: Mapping[str, Any], name: str) -> tuple[float, float] | None:
    """The quantiles (1 %, 99 %) of a quantity; None if the metadata do not hold them, as those of a foreign model."""
    try:
        at, values = np.asarray(quantiles["at"], float), np.asarray(quantiles[name], float)
        low, high = (float(values[np.flatnonzero(at == q)[0]]) for q in (0.01, 0.99))
    except (KeyError, ValueError, IndexError, TypeError, OverflowError):
        return None
    if name == "confidence":
        high = math.inf  # surer than in training is no fault
    return (low, high) if low <= high else None
