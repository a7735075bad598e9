"""Features and measures of a window: the touch-pattern features that the forest takes, and what a gesture looked like.

Source of the features: the paper's touch-pattern set (mean and maximum pressure, variability, row-wise and column-wise
means, maximum and mean contact area, duration). Variability is that of the frames, of the taxels, and of each row and
column; the contact area is also that of the whole gesture. Pressures are shares of the segment's own peak, so they do
not depend on the sensor's gain. A model's metadata (`quantiles`) hold the measures of its training data, with which
those of a deployment are compared.
"""

import numpy as np
from numpy.typing import NDArray

PRESSED = 0.2  # of the peak: for `touch_pattern`, a taxel or a frame from this share on counts as touched

MEASURES = ("duration_s", "area", "speed", "noise")
ACTIVE = 0.15  # of the peak: for `measures`, a frame from this share on counts as touched
COVERED = 0.2  # of the peak: for `measures`, a taxel from this share on counts as touched


def feature_names(rows: int, columns: int) -> tuple[str, ...]:
    """The names of the features that `touch_pattern` returns for windows of rows x columns."""
    lines = [f"row_{r}" for r in range(rows)] + [f"column_{c}" for c in range(columns)]
    return (
        "mean_pressure", "maximum_pressure", "variability", "mean_taxel_variability", "maximum_taxel_variability",
        *(f"{line}_mean" for line in lines), *(f"{line}_variability" for line in lines),
        *(f"{line}_maximum" for line in lines), "maximum_area", "mean_area", "whole_area", "duration_s",
    )  # fmt: skip


def touch_pattern(window: NDArray[np.float32], rate_hz: float) -> NDArray[np.float32]:
    """(T, R, C) window -> (F,) features in the order of `feature_names`.

    Frames without contact are left out, so idle frames around the gesture change nothing.
    """
    touched = window[window.max(axis=(1, 2)) >= PRESSED].astype(np.float64)
    if not len(touched):
        touched = window[:1].astype(np.float64)
    lines = np.concatenate([touched.mean(axis=2), touched.mean(axis=1)], axis=1)  # (T, R + C)
    per_frame = touched.mean(axis=(1, 2))
    per_taxel = touched.std(axis=0)
    area = (touched >= PRESSED).mean(axis=(1, 2))
    whole = (touched.max(axis=0) >= PRESSED).mean()
    values = [
        [per_frame.mean(), touched.max(axis=(1, 2)).mean(), per_frame.std(), per_taxel.mean(), per_taxel.max()],
        lines.mean(axis=0),
        lines.std(axis=0),
        lines.max(axis=0),
        [area.max(), area.mean(), whole, len(touched) / rate_hz],
    ]
    return np.concatenate(values).astype(np.float32)


def measures(window: NDArray[np.float32], rate_hz: float) -> dict[str, float]:
    """(T, R, C) window -> `MEASURES`, all 0 for a window without contact.

    duration_s: length of the frames in contact. area: mean share of the grid in contact. speed: way of the centroid,
    in sides of the grid a second. noise: share of the pressure that is outside of the contact, from the sensor's noise,
    hum, crosstalk, and the skirts of the contact.
    """
    active = window[window.max(axis=(1, 2)) >= ACTIVE].astype(np.float64)
    if not len(active):
        return dict.fromkeys(MEASURES, 0.0)
    contact = np.where(active >= COVERED, active, 0.0)
    total = contact.sum(axis=(1, 2))
    inside = contact[total > 0] / total[total > 0, None, None]
    rows, columns = window.shape[1:]
    down = inside.sum(axis=2) @ (np.arange(rows) / rows)
    across = inside.sum(axis=1) @ (np.arange(columns) / columns)
    duration = len(active) / rate_hz
    return {
        "duration_s": duration,
        "area": float((active >= COVERED).mean()),
        "speed": float(np.hypot(np.diff(down), np.diff(across)).sum()) / duration,
        "noise": 1.0 - float(total.sum()) / float(active.sum()),
    }
