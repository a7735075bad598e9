"""Touch-pattern features as the paper lists them: how strongly, how widely and how long, not in which order.

Mean pressure over taxels and time; the maximum over both; variability, the mean absolute difference of successive
frames over all taxels; the mean of each row and of each column; the largest and the mean contact area of a frame; the
duration. The daemon's own set (`gestured.model.features`) takes standard deviations in the place of that variability,
the mean of the frames' maxima in the place of the maximum, and has the maxima and the variability of rows and columns.

Left open by the paper: from which pressure on a taxel is in contact. Ours is `PRESSED` of the gesture's peak. Frames
without contact count for nothing, so padding changes nothing.
"""

import numpy as np
from numpy.typing import NDArray

from gestured.lab.samples import WINDOW
from gestured.model.features import PRESSED


def paper_features(window: NDArray[np.float32]) -> NDArray[np.float32]:
    """(T, R, C) window -> (6 + R + C,) features."""
    touched = window[window.max(axis=(1, 2)) >= PRESSED].astype(np.float64)
    if not len(touched):
        touched = window[:1].astype(np.float64)
    steps = np.abs(np.diff(touched, axis=0))
    area = (touched >= PRESSED).mean(axis=(1, 2))
    values = [
        [touched.mean(), touched.max(), steps.mean() if len(steps) else 0.0],
        touched.mean(axis=(0, 2)),
        touched.mean(axis=(0, 1)),
        [area.max(), area.mean(), len(touched) / WINDOW.rate_hz],
    ]
    return np.concatenate(values).astype(np.float32)
