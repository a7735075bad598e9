"""The spots of one frame: where each finger presses, to a fraction of a taxel, how hard, and on how many taxels.

Each position is a least-squares fit of a Gaussian spot on a flat base to the taxels around a peak, found in a table of
spots (offset and width) and refined by a parabola through the best one's neighbours. A fit takes only the taxels that
are there, so the border pulls no position inwards, as it would pull a centroid.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Taxels = NDArray[np.int64]

REACH = 2  # taxels on each side of a peak that are fitted
WIDTHS = (0.7, 1.0)  # taxel pitches, standard deviations of spots: fingertips on taxels of 4 to 8 mm; more do no better
STEP, STEPS = 0.25, 3  # taxel pitches between two offsets of the table, and offsets on each side of the peak
BASE = 0.5  # variance of the flat base in units of a taxel's noise: crosstalk and a palm lift what is around a finger
SIDE = 2 * STEPS + 1  # offsets of the table in each direction
TABLES = 64  # the most tables that are kept: one for each way in which the border cuts the taxels around a peak
PEAKS = 1024  # the most places of a peak, on several sensors, for which the taxels around it are kept
SECOND = 0.4  # of the first finger's peak: a second finger is at least so strong, and a palm or crosstalk is not
VALLEY = 0.85  # of the second peak: between two fingers a frame is at most so high
NOISE = 4.0  # noise units: a lower peak is no second finger
APART = 2 * REACH  # taxels: each of two fingers that are nearer is fitted only to itself and its neighbours


_new = tuple.__new__  # Spot(...) takes twice the time


class Spot(NamedTuple):
    """One finger in one frame."""

    row: float  # taxel pitches from the top, as mounted; within the grid
    column: float  # taxel pitches from the left
    peak: float  # counts of its strongest taxel
    area: int  # taxels above half of `peak`


class Peak(NamedTuple):
    """The strongest taxel of a finger, and the taxels that matter for it; all are indices, counted row by row."""

    taxel: int
    row: float
    column: float
    last_row: float  # of the grid
    last_column: float
    beside: Taxels  # the peak and the taxels next to it
    others: Taxels  # all taxels but those
    around: Taxels  # (n,) the taxels that are fitted
    table: Array  # (n, W * SIDE * SIDE) weights of these taxels


def spots(frame: Array, shape: tuple[int, int], noise: float) -> list[Spot]:
    """The fingers in a frame of R x C taxels, the strongest first: one, or two that can be told apart.

    `frame`: (R * C,) counts above the baseline, row by row. If none of them is above it, there is no finger.
    """
    first, second = _peaks(frame, shape, noise)
    level = frame.item(first.taxel)
    if level <= 0:
        return []
    strong = frame > level / 2
    if second is None:
        return [_new(Spot, (*_place(frame, first), level, int(np.count_nonzero(strong))))]
    (_, nearer), other = _pair(shape, first.taxel, second.taxel), frame.item(second.taxel)
    one = Spot(*_place(frame, first), level, int(np.count_nonzero(strong & nearer)))
    return [one, Spot(*_place(frame, second), other, int(np.count_nonzero((frame > other / 2) & ~nearer)))]


def places(frame: Array, shape: tuple[int, int], noise: float) -> list[tuple[float, float]]:
    """The row and the column of each of the `spots` of a frame."""
    return [_place(frame, peak) for peak in _peaks(frame, shape, noise) if peak is not None]


def _peaks(frame: Array, shape: tuple[int, int], noise: float) -> tuple[Peak, Peak | None]:
    """The peak of each finger."""
    first = _peak(shape, int(frame.argmax()), REACH)
    others = frame[first.others]
    if not others.size:
        return first, None
    at = int(others.argmax())
    level = others.item(at)
    if level < SECOND * frame.item(first.taxel) or level < NOISE * noise:
        return first, None
    second = _peak(shape, first.others.item(at), REACH)
    between, _ = _pair(shape, first.taxel, second.taxel)
    if level < frame[second.beside].max() or frame[between].min() > VALLEY * level:
        return first, None  # the second is no peak, or no valley lies between it and the first
    if max(abs(second.row - first.row), abs(second.column - first.column)) > APART:
        return first, second
    return _peak(shape, first.taxel, 1), _peak(shape, second.taxel, 1)


def _place(frame: Array, peak: Peak) -> tuple[float, float]:
    """The row and the column of the finger with this peak."""
    _, row, column, last_row, last_column, _, _, around, table = peak
    fits = frame[around].dot(table)
    best, fit = int(fits.argmax()), fits.item
    down, across, one_down, one_across = _OFFSETS[best]
    # A parabola goes through the best fit and its neighbours; at the edge of the table it is its own neighbour.
    top, above, below = fit(best), fit(best - one_down), fit(best + one_down)
    left, right = fit(best - one_across), fit(best + one_across)
    bend, turn = above - 2 * top + below, left - 2 * top + right
    row += (down + (0.5 * (above - below) / bend if bend < 0 else 0.0)) * STEP
    column += (across + (0.5 * (left - right) / turn if turn < 0 else 0.0)) * STEP
    if not (0.0 <= row <= last_row and 0.0 <= column <= last_column):  # beyond the outermost taxels
        row, column = min(max(row, 0.0), last_row), min(max(column, 0.0), last_column)
    return row, column


def _offset(best: int) -> tuple[int, int, int, int]:
    """Steps of an entry of the table from the peak, down and across, and how far away its neighbours' entries are."""
    down, across = divmod(best % SIDE**2, SIDE)
    return down - STEPS, across - STEPS, SIDE * (0 < down < SIDE - 1), int(0 < across < SIDE - 1)


_OFFSETS = [_offset(best) for best in range(len(WIDTHS) * SIDE**2)]


@lru_cache(PEAKS)
def _peak(shape: tuple[int, int], taxel: int, reach: int) -> Peak:
    """A peak at a taxel, for a fit to the taxels of the grid that are within `reach` of it."""
    (row, column), (rows, columns) = divmod(taxel, shape[1]), shape
    above, below = min(reach, row), min(reach, rows - 1 - row)
    left, right = min(reach, column), min(reach, columns - 1 - column)
    taxels = np.arange(rows * columns).reshape(shape)
    around = taxels[row - above : row + below + 1, column - left : column + right + 1].ravel()
    beside = taxels[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].ravel()
    table = _table(above, below, left, right)
    others = np.delete(taxels.ravel(), beside)
    return Peak(taxel, row, column, rows - 1.0, columns - 1.0, beside, others, around, table)


@lru_cache(PEAKS)
def _pair(shape: tuple[int, int], first: int, second: int) -> tuple[Taxels, NDArray[np.bool_]]:
    """The taxels along the line between two peaks, and (R * C,) whether a taxel is nearer to the first."""
    (row, column), (down, across), columns = divmod(first, shape[1]), divmod(second, shape[1]), shape[1]
    steps = 2 * max(abs(down - row), abs(across - column))
    shares = [k * (1.0 / steps) for k in range(1, steps)]
    between = [round(row + s * (down - row)) * columns + round(column + s * (across - column)) for s in shares]
    rows, across_to = np.indices(shape)
    nearer = (rows - row) ** 2 + (across_to - column) ** 2 < (rows - down) ** 2 + (across_to - across) ** 2
    return np.array(between, np.int64), nearer.ravel()


@lru_cache(TABLES)
def _table(above: int, below: int, left: int, right: int) -> Array:
    """(n, W * SIDE * SIDE) weights, whose product with the n taxels around a peak is greatest for the best fit.

    Let s be a spot of unit height, z the taxels, and K the inverse of the covariance of white noise plus a base of
    variance `BASE`. At the best height of each spot, the residual is least where s K z / sqrt(s K s) is greatest.
    """
    y, x = (axis.ravel().astype(np.float64) for axis in np.mgrid[-above : below + 1, -left : right + 1])
    inverse = np.eye(y.size) - BASE / (1.0 + BASE * y.size)
    at = np.arange(-STEPS, STEPS + 1) * STEP
    width, down, across = (axis.ravel()[:, None] for axis in np.meshgrid(WIDTHS, at, at, indexing="ij"))
    shapes = np.exp(-((y - down) ** 2 + (x - across) ** 2) / (2 * width**2))
    weights = shapes @ inverse
    weights /= np.sqrt((weights * shapes).sum(axis=1, keepdims=True))
    return np.ascontiguousarray(weights.T)  # a product with it is faster than one with its transpose
