"""Medians and quantiles, as numpy has them to the last bit, without the masked arrays that numpy imports for them."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def median(values: Array) -> Array:
    """(n, ...) -> (...), the median along the first axis."""
    ordered = values.copy()
    ordered.sort(axis=0)
    middle = len(ordered) // 2
    return np.asarray(ordered[middle] if len(ordered) % 2 else (ordered[middle - 1] + ordered[middle]) / 2)


def quantile(values: Array, share: float) -> float:
    """The value below which `share` (0..1) of (N,) values lie, interpolated between its two neighbours."""
    ordered = values.copy()
    ordered.sort()
    below = int(share * (len(ordered) - 1))
    beyond = share * (len(ordered) - 1) - below
    low, high = float(ordered[below]), float(ordered[min(below + 1, len(ordered) - 1)])
    return low + (high - low) * beyond if beyond < 0.5 else high - (high - low) * (1 - beyond)
