"""A made finger: a Gaussian blob over Gaussian noise, and what it does on a sensor."""

import numpy as np

from gestured.lab.stability.path import Array, Series

SIGNAL, NOISE, IDLE_LEVEL = 600.0, 2.0, 300.0  # counts of a firm finger, of noise, of an idle taxel
# The largest numbers of float32, one that its square overflows, ordinary ones, two denormals, and both zeros.
FINITE = (float(np.finfo(np.float32).max), 1e30, 1.0, 1e-40, 1e-45, 0.0, -0.0, -1e-40, -1.0, -1e30)


def finger(row: float, column: float, rows: int, columns: int, width: float) -> Array:
    """(R, C) counts of a finger at a row and a column, as wide as `width` taxels."""
    down, right = np.ogrid[:rows, :columns]
    return np.asarray(SIGNAL * np.exp(-((down - row) ** 2 + (right - column) ** 2) / (2 * width**2)))


def swipes(
    count: int, *, shape: tuple[int, int] = (9, 9), rate: float = 15.0, noise: float = NOISE, level: float = IDLE_LEVEL
) -> tuple[Series, tuple[float, ...]]:
    """So many swipes of 0.7 s to the right, 3.7 s apart, the first at 1.5 s; and when they begin."""
    rng = np.random.default_rng(len(shape) * count)
    times = np.arange(int(count * 3.7 * rate)) / rate
    share = (times % 3.7 - 1.5) / 0.7
    frames = level + noise * rng.standard_normal((len(times), *shape))
    size = max(min(shape) / 9, 0.6)
    for k in np.flatnonzero((share >= 0) & (share <= 1)):
        frames[k] += finger((shape[0] - 1) / 2, (0.1 + 0.8 * share[k]) * (shape[1] - 1), *shape, size)
    return Series(times, frames), tuple(1.5 + 3.7 * k for k in range(count))
