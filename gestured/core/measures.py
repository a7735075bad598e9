"""What a gesture looked like, in a few numbers.

Those of the training data stand in a model's metadata (`quantiles`), those of a deployment are held against them.
"""

import numpy as np
from numpy.typing import NDArray

MEASURES = ("duration_s", "area", "speed", "noise")
ACTIVE = 0.15  # of the peak: a frame in contact
COVERED = 0.2  # of the peak: a taxel in contact


def measures(window: NDArray[np.float32], rate_hz: float) -> dict[str, float]:
    """(T, R, C) window -> `MEASURES`, all 0 for one without contact.

    duration_s: of the frames in contact. area: mean share of the grid in contact. speed: way of the centroid, in
    sides of the grid a second. noise: share of the pressure outside of the contact, which is the sensor's noise, hum
    and crosstalk, and the contact's skirts.
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
