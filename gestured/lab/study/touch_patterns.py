"""Touch-pattern features: the daemon's own, and of them the set that the paper lists.

The paper's set is mean and maximum pressure, variability, row-wise and column-wise means, maximum and mean contact
area, and duration. The daemon's (`gestured.core.features`) has in addition the variability of taxels, rows and
columns, their maxima and the area of the whole gesture.

Left open by the paper: of what variability is taken (ours: of the frames' mean pressure), and from which pressure on
a taxel is in contact (ours: a fifth of the gesture's peak).
"""

import numpy as np

from gestured.core.features import feature_names
from gestured.lab.dataset import WINDOW

PLAIN = ("mean_pressure", "maximum_pressure", "variability", "maximum_area", "mean_area", "duration_s")
FEATURE_NAMES = feature_names(WINDOW.rows, WINDOW.columns)


def _plain(name: str) -> bool:
    return name in PLAIN or (name.endswith("_mean") and name.startswith(("row_", "column_")))


PAPER_FEATURES = np.array([_plain(name) for name in FEATURE_NAMES])
