"""What a method sees of a gesture: of all samples at once to learn from, and of one window when it is asked."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.lab.samples import WINDOW, Samples
from gestured.lab.study.motion_history import motion_history
from gestured.lab.study.touch_patterns import paper_features
from gestured.lab.study.training import Images, Windows
from gestured.lab.study.trajectory_boosting import trajectory_matrix, trajectory_row
from gestured.lab.study.wavelets import spatio_temporal
from gestured.model.features import touch_pattern

Values = Mapping[str, Any]  # hyperparameters
Rows = NDArray[np.float32]


@dataclass(frozen=True)
class View:
    """How windows become inputs. `by` names the hyperparameters that it looks at."""

    all: Callable[[Samples, Values, bool], Any]  # samples, hyperparameters, whether padding counts as part of a window
    one: Callable[[Rows, Values], Rows]  # (T, R, C) window, hyperparameters -> a batch of one
    by: tuple[str, ...] = ()


def _alone(one: Callable[[Rows, Values], Rows], *by: str, form: Callable[[Rows], Any] = np.asarray) -> View:
    """A view that looks at each window by itself; `form` is how a net wants all of them."""

    def every(samples: Samples, values: Values, padded: bool) -> Any:
        return form(np.concatenate([one(samples.window(i), values) for i in range(len(samples))]))

    return View(every, one, by)


def _all_touches(samples: Samples, values: Values, padded: bool) -> Rows:
    if values["features"] == "daemon":
        return samples.features()
    return np.stack([paper_features(samples.window(i)) for i in range(len(samples))])


def _touches(window: Rows, values: Values) -> Rows:
    """Touch-pattern features: those that the paper lists, or all that the daemon's forest sees."""
    return (touch_pattern(window, WINDOW.rate_hz) if values["features"] == "daemon" else paper_features(window))[None]


WAVELETS = _alone(
    lambda window, values: spatio_temporal(window, values["wavelet"], values["level"], values["reading"])[None],
    "wavelet",
    "level",
    "reading",
)
TOUCHES = View(_all_touches, _touches, ("features",))
HISTORY = _alone(lambda window, values: motion_history(window, values["decay_s"])[None], "decay_s", form=Images)
FRAMES = View(lambda samples, values, padded: Windows(samples, padded), lambda window, values: window[None])
TRAJECTORIES = View(
    lambda samples, values, padded: trajectory_matrix(samples), lambda window, values: trajectory_row(window)
)
