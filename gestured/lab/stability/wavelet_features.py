"""The study's wavelet features against 50 digits, and what the digits of a window do to them.

Haar's transform is written out here once more, in mpmath: pairs of frames become their sum and their difference, each
over the root of two; a lone last frame is taken twice. Then come the statistics of each band, by their definitions.
"""

from collections.abc import Callable, Iterator
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from gestured.lab.stability.ways import WindowList
from gestured.lab.study.wavelets import TINY, WAVELET, WAVELET_LEVEL, spatio_temporal
from gestured.lab.table import Table, Value

STATISTICS = ("L1 norm", "L2 norm", "skewness", "kurtosis", "standard deviation")
DIGITS = 50
Features = NDArray[np.float64]  # (bands, statistics, taxels)


def exact_features(window: NDArray[np.float32]) -> Features:
    """What `spatio_temporal` gives for each taxel, from the window's own numbers with 50 digits."""
    signals = window.reshape(len(window), -1)
    out = np.zeros((WAVELET_LEVEL + 1, len(STATISTICS), signals.shape[1]))
    with mpmath.workdps(DIGITS):
        for taxel in range(signals.shape[1]):
            signal = [mpmath.mpf(float(value)) for value in signals[:, taxel]]
            signal += [mpmath.mpf(0)] * (2**WAVELET_LEVEL - len(signal))
            for band, values in enumerate(_bands(signal)):
                out[band, :, taxel] = [float(value) for value in _statistics(values)]
    return out


def wavelets_table(windows: WindowList, extreme: WindowList) -> Table:
    """By statistic: error on gestures and on extreme windows, and what float16 windows and a changed `TINY` do."""
    found, right = _all(features_of, windows), _all(exact_features, windows)
    odd, odd_right = _all(features_of, extreme), _all(exact_features, extreme)
    half = _all(features_of, [window.astype(np.float16).astype(np.float32) for window in windows])
    spread = found.std(axis=0)
    moving = spread > 1e-6  # features that are the same for all gestures say nothing
    rows: list[tuple[Value, ...]] = []
    for k, statistic in enumerate(STATISTICS):
        scale = max(float(np.abs(right[:, :, k]).max()), float(np.abs(odd_right[:, :, k]).max()))
        moved = (np.abs(half - found) / np.where(moving, spread, np.inf))[:, :, k]
        rows.append(
            (
                statistic,
                float(np.abs(found - right)[:, :, k].max() / scale),
                float(np.abs(odd - odd_right)[:, :, k].max() / scale),
                float(np.median(moved[moved > 0])) if moved.any() else 0.0,
                float(moved.max()),
            )
        )
    return Table(
        f"Wavelet features ({WAVELET}, level {WAVELET_LEVEL}): error against {DIGITS} digits, and float16 windows",
        (
            "statistic of a band",
            "error, gestures",
            "error, extreme windows",
            "float16 changes by (median)",
            "float16 changes by (most)",
        ),
        rows,
        (
            f"{len(windows)} windows of simulated gestures and {len(extreme)} extreme ones. Errors are shares of the",
            "statistic's largest value. float16: against the same windows in float32, in standard deviations of the",
            f"feature over the gestures, where anything changes. Bands whose variance is at most {TINY:g} have the",
            f"skewness and kurtosis 0: {_near(right)} of {right[:, :, 4].size} bands lie within a factor of 2 of it.",
        ),
    )


def features_of(window: NDArray[np.float32]) -> Features:
    """The study's own, without the means over the taxels."""
    taxels = window[0].size
    found = spatio_temporal(window)[: (WAVELET_LEVEL + 1) * len(STATISTICS) * taxels]
    return found.reshape(WAVELET_LEVEL + 1, len(STATISTICS), taxels).astype(np.float64)


def _bands(signal: list[Any]) -> Iterator[list[Any]]:
    """The approximation, then the details from the coarsest to the finest."""
    root, details = mpmath.sqrt(2), []
    for _ in range(WAVELET_LEVEL):
        signal = signal + signal[-1:] * (len(signal) % 2)
        pairs = list(zip(signal[::2], signal[1::2], strict=True))
        details.append([(a - b) / root for a, b in pairs])
        signal = [(a + b) / root for a, b in pairs]
    return iter([signal, *reversed(details)])


def _statistics(band: list[Any]) -> list[Any]:
    mean = mpmath.fsum(band) / len(band)
    two, three, four = (mpmath.fsum((x - mean) ** power for x in band) / len(band) for power in (2, 3, 4))
    still = two <= TINY
    shape = [0, 0] if still else [three / two ** mpmath.mpf(1.5), four / two**2 - 3]
    return [mpmath.fsum(map(abs, band)), mpmath.sqrt(mpmath.fsum(x * x for x in band)), *shape, mpmath.sqrt(two)]


def _all(features: Callable[[NDArray[np.float32]], Features], windows: WindowList) -> NDArray[np.float64]:
    return np.stack([features(window) for window in windows])


def _near(right: NDArray[np.float64]) -> int:
    """Bands that a small change makes still, or no longer."""
    variance = right[:, :, 4] ** 2
    return int(((variance > TINY / 2) & (variance < TINY * 2)).sum())
