"""Where the finger went: the trajectory features of the daemon's second opinion, for gradient boosting.

The features are those of `gestured.lab.trajectory` (centroid path at equal distances, turning, straightness, width,
number of fingers and contacts), computed by the same code that stands in the shipped models' graph.
"""

import numpy as np
import torch
from numpy.typing import NDArray

from gestured.lab.fit import batch_of
from gestured.lab.samples import Samples
from gestured.lab.trajectory import trajectory_features

BATCH_WINDOWS = 256


def trajectory_matrix(samples: Samples) -> NDArray[np.float32]:
    """(G, F) of all samples."""
    order = np.argsort(samples.lengths(), kind="stable")
    batches = [order[i : i + BATCH_WINDOWS] for i in range(0, len(order), BATCH_WINDOWS)]
    with torch.no_grad():
        parts = [trajectory_features(*batch_of(samples, batch)).numpy() for batch in batches]
    found = np.concatenate(parts)
    return np.asarray(found[np.argsort(order, kind="stable")], np.float32)


def trajectory_row(window: NDArray[np.float32]) -> NDArray[np.float32]:
    """(T, R, C) window -> (1, F)."""
    with torch.no_grad():
        return np.asarray(trajectory_features(torch.from_numpy(window[None])).numpy(), np.float32)
