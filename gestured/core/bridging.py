"""What bad taxels would show: the mean of their good neighbours."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NEAR, DIAGONAL = 2.0, 1.0  # weights of a taxel's eight neighbours


def bridged(frames: Array, bad: Mask) -> Array:
    """(T, R, C) counts -> the same with the (R, C) bad taxels replaced by what their good neighbours show.

    Those inside a bad patch are filled from its rim inwards. Where no taxel is good, nothing is replaced.
    """
    good = ~bad
    if good.all() or not good.any():
        return frames
    frames = np.where(good, frames, 0.0)
    while not good.all():
        around = neighbour_mean(frames, good)
        fill = ~good & (neighbour_mean(good.astype(float), np.ones_like(good)) > 0)
        frames = np.where(fill, around, frames)
        good = good | fill
    return frames


def neighbour_mean(grid: NDArray[np.floating], good: Mask) -> Array:
    """(..., R, C) -> the weighted mean of each taxel's neighbours, of the (R, C) good ones; 0 where none is good."""
    pad = [(0, 0)] * (grid.ndim - 2) + [(1, 1), (1, 1)]
    values = np.pad(np.where(good, grid, 0.0), pad)
    weight = np.pad(good.astype(float), 1)
    rows, columns = good.shape
    total = np.zeros(grid.shape)
    count = np.zeros(good.shape)
    for i in range(3):
        for j in range(3):
            if (i, j) != (1, 1):
                share = NEAR if 1 in (i, j) else DIAGONAL
                total += share * values[..., i : i + rows, j : j + columns]
                count += share * weight[i : i + rows, j : j + columns]
    return total / np.maximum(count, 1e-9)  # without a good neighbour the total is 0 as well
