"""Touch-pattern features of a window: what was pressed and for how long, without the order of the frames.

Source: the paper's touch-pattern set (mean and maximum pressure, variability, row-wise and column-wise means,
maximum and mean contact area, duration). Pressures are shares of the segment's own peak, so that they do not
depend on the sensor's gain.
"""

import numpy as np
from numpy.typing import NDArray

PRESSED = 0.2  # of the peak: a taxel in contact


def feature_names(rows: int, columns: int) -> tuple[str, ...]:
    """Names of what `touch_pattern` returns for windows of rows x columns."""
    return (
        "mean_pressure", "maximum_pressure", "variability",
        *(f"row_{r}_mean" for r in range(rows)), *(f"column_{c}_mean" for c in range(columns)),
        "maximum_area", "mean_area", "duration_s",
    )  # fmt: skip


def touch_pattern(window: NDArray[np.float32], rate_hz: float) -> NDArray[np.float32]:
    """(T, R, C) window -> (F,) features in the order of `feature_names`.

    Frames without contact count for nothing, so idle frames around the gesture change nothing.
    """
    peaks = window.max(axis=(1, 2))
    touched = window[peaks >= PRESSED]
    if not len(touched):
        touched = window[:1]
    per_frame = touched.mean(axis=(1, 2), dtype=np.float64)
    area = (touched >= PRESSED).mean(axis=(1, 2))
    values = [
        [per_frame.mean(), touched.max(axis=(1, 2)).mean(), per_frame.std()],
        touched.mean(axis=(0, 2), dtype=np.float64),
        touched.mean(axis=(0, 1), dtype=np.float64),
        [area.max(), area.mean(), len(touched) / rate_hz],
    ]
    return np.concatenate(values).astype(np.float32)
