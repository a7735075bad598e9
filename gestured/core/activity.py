"""Activity: how strongly a frame is pressed, in units of the sensor's noise, and where.

Frames are not smoothed over time, since at 15 Hz a tap is one to three frames.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gestured.core.idle import NOISE_TAU_S
from gestured.core.quantiles import median

Array = NDArray[np.float64]

COMMON = 4.0  # noise units: the most that is subtracted for what all taxels share, since a palm must not cancel itself
BLOB = (0.5, 1.0, 0.5)  # a fingertip over three taxels, in rows and in columns
BLOB_GAIN = sum(BLOB) ** 2 / sum(b * b for b in BLOB)  # factor by which a level that all taxels share grows in a spot
PLACE_SHARE = 0.3  # of the highest taxel: lower taxels say nothing of where the finger is
PLACE_NOISE = 3.5  # noise units above which a taxel says where the finger is
TYPICAL = 0.88  # median activity of an idle frame with normal noise, in units of sqrt(2 ln N)
USUAL_AT_MOST = 5.0  # the largest `scale`: a sensor that seems more restless is touched, or faulty
SURPRISE = 2.0  # times the typical activity: the most for which one idle frame counts, so that none rules the average


def rarely(taxels: int) -> float:
    """The activity that the strongest of so many idle taxels rarely exceeds, in noise units."""
    return 1.0 + math.sqrt(2 * math.log(taxels))


def hardly_ever(taxels: int) -> float:
    """The activity that the strongest of so many idle taxels almost never exceeds, in noise units."""
    return 3.0 + math.sqrt(2 * math.log(taxels))


class Activity:
    """The activity of a sensor of R x C taxels, and how high it usually is while the sensor is idle.

    Clipping, hum and bursts make idle frames more active than normal noise would. `scale` is the factor by which
    the noise units of this sensor are enlarged.
    """

    def __init__(self, rows: int, columns: int) -> None:
        self.rows, self.columns = rows, columns
        self.scale = 1.0
        self._down, self._across = _blob(rows), _blob(columns)
        self._each_row, self._each_column = np.arange(float(rows)), np.arange(float(columns))
        self.typical = TYPICAL * math.sqrt(2 * math.log(rows * columns))  # median activity where noise is normal
        self.usual = self.typical  # median activity as it is, before `scale`

    def measure(self, scaled: Array) -> tuple[float, float]:
        """The strongest spot (a taxel alone, or with its neighbours) and the lowest taxel of (N,) deviations.

        All are in noise units. A finger between two taxels shows half on each, so the neighbours are weighed in: a
        matched filter of a blob, normalised to the same noise. What all taxels share is no finger, and is subtracted.
        """
        # Every frame passes here. At this size one sort is faster than a minimum, a median and a maximum, `dot` is
        # faster than `@`, `argmax` than `max`, and a comparison than a call.
        ordered = scaled.copy()
        ordered.sort()
        spots = self._down.dot(scaled.reshape(self.rows, self.columns)).dot(self._across)
        strongest = spots.item(spots.argmax())
        common = ordered.item(ordered.size // 2)
        common = COMMON if common > COMMON else -COMMON if common < -COMMON else common
        alone, spot = ordered.item(-1) - common, strongest - common * BLOB_GAIN
        return spot if spot > alone else alone, ordered.item(0)

    def measure_all(self, scaled: Array) -> tuple[Array, Array]:
        """What `measure` gives for each of n sensors, by their (n, N) deviations, which it sorts: (n,) and (n,)."""
        spots = np.matmul(np.matmul(self._down, scaled.reshape(-1, self.rows, self.columns)), self._across)
        scaled.sort(axis=1)
        common = np.minimum(np.maximum(scaled[:, scaled.shape[1] // 2], -COMMON), COMMON)
        strongest = spots.reshape(scaled.shape).max(axis=1) - common * BLOB_GAIN
        return np.maximum(strongest, scaled[:, -1] - common), scaled[:, 0]

    def place(self, pressed: Array, noise: float) -> tuple[float, float]:
        """The centroid (row, column), in taxel pitches, of (N,) counts that clearly rise above 0 and above `noise`."""
        top = pressed.item(pressed.argmax())
        share, noise = PLACE_SHARE * top, PLACE_NOISE * noise
        cut = share if noise >= top else max(share, noise)
        grid = np.maximum(pressed - cut, 0.0).reshape(self.rows, self.columns)
        total = np.add.reduce(grid, None).item()  # the method `sum` costs twice as much at this size
        if not total > 0:
            return (self.rows - 1) / 2, (self.columns - 1) / 2
        down, across = np.add.reduce(grid, 1), np.add.reduce(grid, 0)
        return down.dot(self._each_row).item() / total, across.dot(self._each_column).item() / total

    def unlearn(self) -> None:
        """Take the sensor's noise for normal until `learn` is called."""
        self.scale, self.usual = 1.0, 0.0

    def learn(self, scaled: Array) -> None:
        """Learn the usual activity from (n, N) deviations of idle frames, in noise units with a `scale` of 1."""
        self.usual = float(median(self.measure_all(scaled)[0]))

    def follow(self, t: float, since: float, activity: float) -> None:
        """Let the usual activity follow a sensor that was idle from `since` to `t` s, by its `activity` at `t`."""
        seen = min(activity, SURPRISE * self.typical) * self.scale
        self.usual += (seen - self.usual) * -math.expm1((since - t) / NOISE_TAU_S)

    def review(self) -> None:
        """Set `scale` by the usual activity."""
        self.scale = min(max(self.usual / self.typical, 1.0), USUAL_AT_MOST)


@cache
def _blob(size: int) -> Array:
    """(size, size) banded weights of `BLOB`, normalised so that white noise keeps its size; all sensors share them."""
    side, middle, _ = BLOB
    band = middle * np.eye(size) + side * (np.eye(size, k=1) + np.eye(size, k=-1))
    weights = np.asarray(band / math.sqrt(sum(b * b for b in BLOB)))
    weights.setflags(write=False)
    return weights
