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
    peaks = _peaks(frame, noise)
    if len(peaks) == 1:
        (first, reach), level = peaks[0], frame.item(peaks[0][0]) / 2
        return [_new(Spot, (*_place(frame, first, reach), 2 * level, (frame > level).tobytes().count(1)))]
    (row, column), (down, across) = (divmod(peak, frame.shape[1]) for peak, _ in peaks)
    rows, columns = np.indices(frame.shape)  # below: less far from the first peak than half-way
    nearer = rows * (down - row) + columns * (across - column) < (down**2 + across**2 - row**2 - column**2) / 2
    found: list[Spot] = []
    for (peak, reach), own in zip(peaks, (nearer, ~nearer), strict=True):
        level = frame.item(peak)
        area = int(np.count_nonzero((frame > level / 2) & own))
        found.append(_new(Spot, (*_place(frame, peak, reach), level, area)))
    return found


def places(frame: Array, noise: float) -> list[tuple[float, float]]:
    """The row and the column of each of the `spots` of a frame."""
    return [_place(frame, peak, reach) for peak, reach in _peaks(frame, noise)]


def _peaks(frame: Array, noise: float) -> tuple[tuple[int, int], ...]:
    """The strongest taxel of each finger, and how far a fit looks around it."""
    first = int(frame.argmax())
    second = int((frame * _elsewhere(frame.shape, first)).argmax())
    peak = frame.item(second)
    if peak < SECOND * frame.item(first) or peak < NOISE * noise or not _parted(frame, first, second):
        return ((first, REACH),)
    (row, column), (down, across) = divmod(first, frame.shape[1]), divmod(second, frame.shape[1])
    reach = 1 if max(abs(down - row), abs(across - column)) <= APART else REACH
    return (first, reach), (second, reach)


def _parted(frame: Array, first: int, second: int) -> bool:
    """Whether the second taxel is a peak, and a valley lies between it and the first."""
    peak, (beside, between) = frame.item(second), _ways(frame.shape, first, second)
    return peak >= frame.take(beside).max() and bool((frame.take(between) <= VALLEY * peak).any())


def _place(frame: Array, peak: int, reach: int) -> tuple[float, float]:
    """The row and the column of the finger whose strongest taxel is `peak`."""
    row, column, last_row, last_column, around, table = _around(frame.shape, peak, reach)
    fits = table.dot(frame.take(around))
    best, at = int(fits.argmax()), fits.item
    down, across, one_down, one_across = _OFFSETS[best]
    # A parabola through the best fit's neighbours; at the edge of the table these are the best fit itself.
    top, above, below = at(best), at(best - one_down), at(best + one_down)
    left, right = at(best - one_across), at(best + one_across)
    bend, turn = above - 2 * top + below, left - 2 * top + right
    down_to = row + (down + (0.5 * (above - below) / bend if bend < 0 else 0.0)) * STEP
    across_to = column + (across + (0.5 * (left - right) / turn if turn < 0 else 0.0)) * STEP
    if not (0.0 <= down_to <= last_row and 0.0 <= across_to <= last_column):  # beyond the outermost taxels
        down_to, across_to = min(max(down_to, 0.0), last_row), min(max(across_to, 0.0), last_column)
    return down_to, across_to


def _offset(best: int) -> tuple[int, int, int, int]:
    """Steps of an entry of the table from the peak, downward and across, and how far it is to its neighbours there."""
    down, across = divmod(best % SIDE**2, SIDE)
    return down - STEPS, across - STEPS, SIDE * (0 < down < SIDE - 1), int(0 < across < SIDE - 1)


_OFFSETS = [_offset(best) for best in range(len(WIDTHS) * SIDE**2)]


@lru_cache(PEAKS)
def _elsewhere(shape: tuple[int, int], peak: int) -> Array:
    """(R, C) 0 at a peak and the taxels beside it, 1 elsewhere."""
    found = np.ones(shape)
    row, column = divmod(peak, shape[1])
    found[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = 0.0
    return found


@lru_cache(PEAKS)
def _ways(shape: tuple[int, int], first: int, second: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The taxels beside the second of two, and those along the line between both."""
    taxels, (row, column), (down, across) = _taxels(shape), divmod(first, shape[1]), divmod(second, shape[1])
    steps = 2 * max(abs(down - row), abs(across - column))
    shares = [k * (1.0 / steps) for k in range(1, steps)]
    between = [taxels[round(row + s * (down - row)), round(column + s * (across - column))] for s in shares]
    return taxels[max(down - 1, 0) : down + 2, max(across - 1, 0) : across + 2].ravel(), np.array(between, np.int64)


@lru_cache(PEAKS)
def _around(shape: tuple[int, int], peak: int, reach: int) -> tuple[int, int, float, float, NDArray[np.int64], Array]:
    """A peak's row and column, the last of each, the taxels that a fit looks at, row by row, and the table for them."""
    (row, column), (rows, columns) = divmod(peak, shape[1]), shape
    above, below = min(reach, row), min(reach, rows - 1 - row)
    left, right = min(reach, column), min(reach, columns - 1 - column)
    around = _taxels(shape)[row - above : row + below + 1, column - left : column + right + 1].ravel()
    return row, column, rows - 1.0, columns - 1.0, around, _table(above, below, left, right)


def _taxels(shape: tuple[int, int]) -> NDArray[np.int64]:
    """(R, C) the number of each taxel, row by row."""
    return np.arange(shape[0] * shape[1]).reshape(shape)


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
