"""What a method sees of a gesture: of all samples at once to learn from, and of one window when it is asked."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.features import touch_pattern
from gestured.lab.dataset import WINDOW, Samples
from gestured.lab.study.motion_history import motion_history, motion_history_images
from gestured.lab.study.touch_patterns import PAPER, touch_pattern_features
from gestured.lab.study.training import Images, Windows
from gestured.lab.study.trajectory_boosting import trajectory_matrix, trajectory_row
from gestured.lab.study.wavelets import spatio_temporal, spatio_temporal_features

Values = Mapping[str, Any]  # hyperparameters
Rows = NDArray[np.float32]


@dataclass(frozen=True)
class View:
    """How windows become inputs. `by` names the hyperparameters that it looks at."""

    all: Callable[[Samples, Values, bool], Any]  # samples, hyperparameters, whether padding counts as part of a window
    one: Callable[[Rows, Values], Rows]  # (T, R, C) window, hyperparameters -> a batch of one
    by: tuple[str, ...] = ()


WAVELETS = View(
    lambda samples, values, padded: spatio_temporal_features(samples, values["wavelet"], values["level"]),
    lambda window, values: spatio_temporal(window, values["wavelet"], values["level"])[None],
    ("wavelet", "level"),
)


def _touches(window: Rows, values: Values) -> Rows:
    found = touch_pattern(window, WINDOW.rate_hz)
    return (found[PAPER] if values["features"] == "paper" else found)[None]


TOUCHES = View(
    lambda samples, values, padded: touch_pattern_features(samples, values["features"]), _touches, ("features",)
)
HISTORY = View(
    lambda samples, values, padded: Images(motion_history_images(samples, values["decay_s"])),
    lambda window, values: motion_history(window, values["decay_s"])[None],
    ("decay_s",),
)
FRAMES = View(lambda samples, values, padded: Windows(samples, padded), lambda window, values: window[None])
TRAJECTORIES = View(
    lambda samples, values, padded: trajectory_matrix(samples), lambda window, values: trajectory_row(window)
)
