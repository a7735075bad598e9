"""The fingers of one frame: where each presses, to a fraction of a taxel, how hard, and on how many taxels.

Each position is a least-squares fit of a Gaussian spot on a flat base to the taxels around a peak, found in a table of
spots (offset and width) and refined by a parabola through the best one's neighbours. A fit takes only the taxels that
are there, so the border pulls no position inwards, as it would pull a centroid.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REACH = 2  # taxels on each side of a peak that a fit looks at
WIDTHS = (0.5, 0.7, 1.0, 1.4)  # pitches, one standard deviation: fingertips on taxels of 4 to 8 mm, blurred
STEP, STEPS = 0.25, 3  # pitches from one offset of the table to the next, and how many on each side of the peak
BASE = 0.5  # variance of the flat base in units of a taxel's noise: crosstalk and a palm lift what is around a finger
SIDE = 2 * STEPS + 1
TABLES = 64  # tables that are kept: one for each way in which the border cuts the taxels around a peak
PEAKS = 1024  # places of a peak for which it is kept which taxels are around it: those of several sensors
SECOND = 0.4  # of the first finger's peak: a second one is at least as strong, since a palm and crosstalk are not
VALLEY = 0.85  # of the second peak: what lies between two fingers is at most so high
NOISE = 4.0  # noise units: a lower peak is no second finger
APART = 2 * REACH  # taxels: fingers that are nearer are fitted to their own taxels alone


_new = tuple.__new__  # Spot(...) takes twice the time


class Spot(NamedTuple):
    """One finger in one frame."""

    row: float  # taxel pitches from the top, as mounted; within the grid
    column: float  # from the left
    peak: float  # counts of its strongest taxel
    area: int  # taxels above half of that


def spots(frame: Array, noise: float) -> list[Spot]:
    """The fingers in (R, C) counts above the baseline, the strongest first: one, or two that can be told apart."""
    best = int(frame.argmax())
    first, top = divmod(best, frame.shape[1]), frame.item(best)
    second = _second(frame, first, top, noise)
    if second is None:
        return [_spot(frame, first, REACH, (frame > top / 2).tobytes().count(1))]  # np.count_nonzero takes longer
    down, across = second[0] - first[0], second[1] - first[1]
    near = max(abs(down), abs(across)) <= APART
    rows, columns = (np.arange(side) for side in frame.shape)  # below: less far from the first peak than half-way
    middle = (second[0] ** 2 + second[1] ** 2 - first[0] ** 2 - first[1] ** 2) / 2
    nearer = (rows * down)[:, None] + columns * across < middle
    return [
        _spot(frame, peak, 1 if near else REACH, int(np.count_nonzero((frame > frame.item(peak) / 2) & own)))
        for peak, own in ((first, nearer), (second, ~nearer))
    ]


def _second(frame: Array, first: tuple[int, int], top: float, noise: float) -> tuple[int, int] | None:
    """The peak of a second finger; None where there is none, or it cannot be told from the first."""
    (row, column), (rows, columns) = first, frame.shape
    at = int((frame * _elsewhere(rows, columns, row, column)).argmax())
    peak = frame.item(at)
    if peak < SECOND * top or peak < NOISE * noise:
        return None
    down, across = divmod(at, columns)
    if peak < frame[max(down - 1, 0) : down + 2, max(across - 1, 0) : across + 2].max():
        return None
    steps = 2 * max(abs(down - row), abs(across - column))
    for k in range(1, steps):  # along the line between both
        share = k * (1.0 / steps)
        if frame.item(round(row + share * (down - row)), round(column + share * (across - column))) <= VALLEY * peak:
            return down, across
    return None


def _spot(frame: Array, peak: tuple[int, int], reach: int, area: int) -> Spot:
    (row, column), (rows, columns) = peak, frame.shape
    around, table = _around(rows, columns, row, column, reach)
    fits = table.dot(frame.take(around))
    best = int(fits.argmax())
    down, across = divmod(best % SIDE**2, SIDE)
    top, at = fits.item(best), fits.item
    dy = _summit(at(best - SIDE), top, at(best + SIDE)) if 0 < down < SIDE - 1 else 0.0
    dx = _summit(at(best - 1), top, at(best + 1)) if 0 < across < SIDE - 1 else 0.0
    down_to, across_to = row + (down - STEPS + dy) * STEP, column + (across - STEPS + dx) * STEP
    if not (0.0 <= down_to <= rows - 1 and 0.0 <= across_to <= columns - 1):  # beyond the outermost taxels
        down_to, across_to = min(max(down_to, 0.0), rows - 1.0), min(max(across_to, 0.0), columns - 1.0)
    return _new(Spot, (down_to, across_to, frame.item(peak), area))


@lru_cache(PEAKS)
def _elsewhere(rows: int, columns: int, row: int, column: int) -> Array:
    """(R, C) 0 at a peak and the taxels beside it, 1 elsewhere."""
    found = np.ones((rows, columns))
    found[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = 0.0
    return found


def _summit(before: float, top: float, after: float) -> float:
    """Where a parabola through three values is highest, in steps from the middle one."""
    bend = before - 2 * top + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0


@lru_cache(PEAKS)
def _around(rows: int, columns: int, row: int, column: int, reach: int) -> tuple[NDArray[np.int64], Array]:
    """The taxels around a peak that a fit looks at, row by row, and the table for them."""
    above, below = min(reach, row), min(reach, rows - 1 - row)
    left, right = min(reach, column), min(reach, columns - 1 - column)
    taxels = np.arange(rows * columns).reshape(rows, columns)
    around = taxels[row - above : row + below + 1, column - left : column + right + 1].ravel()
    return around, _table(above, below, left, right)


@lru_cache(TABLES)
def _table(above: int, below: int, left: int, right: int) -> Array:
    """(W * SIDE * SIDE, n) weights: their product with the n taxels around a peak is greatest for the best fit.

    For a spot s of unit height, noise that is white and a base of variance `BASE`, with K the inverse of their joint
    covariance, the residual of the best height is least where s K z / sqrt(s K s) is greatest (z: the taxels).
    """
    y, x = (axis.ravel().astype(np.float64) for axis in np.mgrid[-above : below + 1, -left : right + 1])
    inverse = np.eye(y.size) - BASE / (1.0 + BASE * y.size)
    at = np.arange(-STEPS, STEPS + 1) * STEP
    width, down, across = (axis.ravel()[:, None] for axis in np.meshgrid(WIDTHS, at, at, indexing="ij"))
    shapes = np.exp(-((y - down) ** 2 + (x - across) ** 2) / (2 * width**2))
    weights = shapes @ inverse
    return np.asarray(weights / np.sqrt((weights * shapes).sum(axis=1, keepdims=True)))
