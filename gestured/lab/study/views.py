"""Views: the inputs of a method, of all samples at once to learn from, and of one window to answer."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pywt
import torch
from numpy.typing import NDArray

from gestured.lab.fit import asked
from gestured.lab.samples import WINDOW, Samples
from gestured.lab.study.training import Images, Windows
from gestured.lab.trajectory import trajectory_features
from gestured.model.features import PRESSED, touch_pattern

Values = Mapping[str, Any]  # hyperparameters
Rows = NDArray[np.float32]
WHOLE = 0.0  # stands for a decay as long as the gesture
WAVELET = "haar"
WAVELET_LEVEL = 3
TAXELS, POOLED = "taxels", "pooled"  # readings of the paper's features
TOGETHER = 256  # windows whose wavelets are computed together: more of them do not fit into the cache
TINY = 1e-9  # variance (of shares of the peak) at which a band counts as constant


def motion_history(window: NDArray[np.floating], decay_s: float = WHOLE) -> NDArray[np.float32]:
    """(T, R, C) window -> (R, C) image, 0..1: the whole gesture, in which what was pressed last is brightest.

    A taxel is 1 while it is pressed and falls linearly afterwards, to 0 after `decay_s` (Bobick and Davis 2001, with
    the pressed taxels in the place of moving ones). The image is taken at the last frame with contact. The paper leaves
    the decay open. Ours is as long as the gesture itself (0 stands for that), so that a slow swipe and a fast one leave
    the same picture. A taxel is pressed from a fifth of the gesture's peak on.
    """
    pressed = window >= PRESSED
    frames = np.flatnonzero(pressed.any(axis=(1, 2)))
    if not len(frames):
        return np.zeros(window.shape[1:], np.float32)
    pressed = pressed[frames[0] : frames[-1] + 1]
    time = len(pressed)
    age = pressed[::-1].argmax(axis=0)  # frames since it was pressed
    decay = decay_s * WINDOW.rate_hz if decay_s > 0 else float(time)
    image = np.maximum(1.0 - age / decay, 0.0) * pressed.any(axis=0)
    return np.asarray(image, np.float32)


def paper_features(window: NDArray[np.float32]) -> NDArray[np.float32]:
    """(T, R, C) window -> (6 + R + C,) the paper's touch-pattern features, which ignore the order of frames.

    Mean pressure over taxels and time; the maximum over both; variability, the mean absolute difference of successive
    frames over all taxels; the mean of each row and of each column; the largest and the mean contact area of a frame;
    the duration. The daemon's own set (`gestured.model.features`) takes standard deviations in the place of that
    variability, the mean of the frames' maxima in the place of the maximum, and has the maxima and the variability of
    rows and columns. The paper leaves open from which pressure on a taxel is in contact. Ours is `PRESSED` of the
    gesture's peak. Frames without contact count for nothing, so padding changes nothing.
    """
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


def band_statistics(bands: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, n, taxels) -> (N, 5, taxels): L1, L2, skewness, kurtosis (0 for a Gaussian), standard deviation."""
    centred = bands - bands.mean(axis=1, keepdims=True)
    variance = np.mean(centred**2, axis=1)
    still = variance <= TINY
    safe = np.where(still, 1.0, variance)
    skewness = np.where(still, 0.0, np.mean(centred**3, axis=1) / safe**1.5)
    kurtosis = np.where(still, 0.0, np.mean(centred**4, axis=1) / safe**2 - 3.0)
    return np.stack([np.abs(bands).sum(1), np.sqrt((bands**2).sum(1)), skewness, kurtosis, np.sqrt(variance)], 1)


def spatio_temporal(
    windows: NDArray[np.floating], wavelet: str = WAVELET, level: int = WAVELET_LEVEL, reading: str = TAXELS
) -> NDArray[np.float32]:
    """(N, T, R, C) windows -> (N, F): statistics of the bands of every taxel's discrete wavelet transform.

    For each band: L1 and L2 norm, skewness, kurtosis and standard deviation, and for each of these the mean, maximum
    and variance over the taxels. The paper has the statistics and, in addition, the three spatial features; `TAXELS` is
    that reading and the default: levels + 1 bands x 5 x (R C + 3) features. `POOLED` keeps the spatial features alone,
    x 5 x 3, and forgets which taxel it was.

    Left open by the paper: wavelet and level. Ours are Haar's and 3: the median gesture has 11 frames, and a
    longer wavelet or a higher level sees mostly what was padded. A signal that is too short is followed by zeros, which
    is what an untouched sensor shows. Skewness and kurtosis of a constant band are zero, not NaN.
    """
    count, frames = windows.shape[:2]
    missing = max(2**level * (pywt.Wavelet(wavelet).dec_len - 1) - frames, 0)
    signals = np.pad(windows.reshape(count, frames, -1).astype(np.float64), ((0, 0), (0, missing), (0, 0)))
    bands = pywt.wavedec(signals, wavelet, mode="symmetric", level=level, axis=1)
    found = np.concatenate([band_statistics(band) for band in bands], axis=1)  # (N, (level + 1) * 5, taxels)
    spatial = np.concatenate([found.mean(2), found.max(2), found.var(2)], axis=1)
    if reading == TAXELS:
        spatial = np.concatenate([found.reshape(count, -1), spatial], axis=1)
    return spatial.astype(np.float32)


def trajectory_matrix(samples: Samples) -> NDArray[np.float32]:
    """(G, F) trajectory features of all samples, by the code that stands in the shipped models' graph."""
    return np.asarray(asked(samples, lambda x, lengths: [trajectory_features(x, lengths)])[0].numpy(), np.float32)


def trajectory_row(window: NDArray[np.float32]) -> NDArray[np.float32]:
    """(T, R, C) window -> (1, F)."""
    with torch.no_grad():
        return np.asarray(trajectory_features(torch.from_numpy(window[None])).numpy(), np.float32)


@dataclass(frozen=True)
class View:
    """How windows become inputs. `by` names the hyperparameters on which these depend."""

    all: Callable[[Samples, Values, bool], Any]  # samples, hyperparameters, whether padding counts as part of a window
    one: Callable[[Rows, Values], Rows]  # (T, R, C) window, hyperparameters -> a batch of one
    by: tuple[str, ...] = ()


def _alone(one: Callable[[Rows, Values], Rows], *by: str, form: Callable[[Rows], Any] = np.asarray) -> View:
    """A view of each window by itself; `form` makes a net's inputs of all of them."""

    def every(samples: Samples, values: Values, padded: bool) -> Any:
        return form(np.concatenate([one(samples.window(i), values) for i in range(len(samples))]))

    return View(every, one, by)


def _touches(window: Rows, values: Values) -> Rows:
    """Touch-pattern features: those that the paper lists, or all that the daemon's forest sees."""
    return (touch_pattern(window, WINDOW.rate_hz) if values["features"] == "daemon" else paper_features(window))[None]


def _wavelets(windows: Rows, values: Values) -> Rows:
    return spatio_temporal(windows, values["wavelet"], values["level"], values["reading"])


def _all_wavelets(samples: Samples, values: Values, padded: bool) -> Rows:
    """Windows of one length together, which is many times as fast as one by one."""
    index, rows = zip(*((some, _wavelets(of, values)) for some, of in samples.alike(TOGETHER)), strict=True)
    return np.concatenate(rows)[np.argsort(np.concatenate(index))]


WAVELETS = View(_all_wavelets, lambda window, values: _wavelets(window[None], values), ("wavelet", "level", "reading"))
TOUCHES = _alone(_touches, "features")
HISTORY = _alone(lambda window, values: motion_history(window, values["decay_s"])[None], "decay_s", form=Images)
FRAMES = View(lambda samples, values, padded: Windows(samples, padded), lambda window, values: window[None])
TRAJECTORIES = View(
    lambda samples, values, padded: trajectory_matrix(samples), lambda window, values: trajectory_row(window)
)
