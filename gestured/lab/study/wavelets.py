"""Spatio-temporal features: the discrete wavelet transform of every taxel's signal, and statistics of its bands.

Each taxel's signal over the gesture is transformed (PyWavelets). Of each band: L1 and L2 norm, skewness, kurtosis and
standard deviation, and of each of these the mean, maximum and variance over the taxels. The paper has the statistics
and, in addition, the three spatial features; `TAXELS` is that reading and the default: levels + 1 bands x 5 x (R C + 3)
features. `POOLED` keeps the spatial features alone, x 5 x 3, and forgets which taxel it was.

Left open by the paper: wavelet and level. Ours are Haar's and 3: the median gesture has 11 frames, and a
longer wavelet or a higher level sees mostly what was padded. A signal that is too short is followed by zeros, which
is what an untouched sensor shows. Skewness and kurtosis of a constant band are zero, not NaN.
"""

import numpy as np
import pywt
from numpy.typing import NDArray

WAVELET = "haar"
WAVELET_LEVEL = 3
TAXELS, POOLED = "taxels", "pooled"  # readings of what the features are
TINY = 1e-9  # variance (of shares of the peak) at which a band counts as constant


def band_statistics(band: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, taxels) coefficients -> (5, taxels): L1, L2, skewness, kurtosis (0 for a Gaussian), standard deviation."""
    centred = band - band.mean(axis=0)
    variance = np.mean(centred**2, axis=0)
    still = variance <= TINY
    safe = np.where(still, 1.0, variance)
    skewness = np.where(still, 0.0, np.mean(centred**3, axis=0) / safe**1.5)
    kurtosis = np.where(still, 0.0, np.mean(centred**4, axis=0) / safe**2 - 3.0)
    return np.stack([np.abs(band).sum(0), np.sqrt((band**2).sum(0)), skewness, kurtosis, np.sqrt(variance)])


def spatio_temporal(
    window: NDArray[np.floating], wavelet: str = WAVELET, level: int = WAVELET_LEVEL, reading: str = TAXELS
) -> NDArray[np.float32]:
    """(T, R, C) window -> features: each band's statistics of each taxel, then their mean, maximum and variance."""
    signals = window.reshape(len(window), -1).astype(np.float64)
    least = 2**level * (pywt.Wavelet(wavelet).dec_len - 1)
    if len(signals) < least:
        signals = np.concatenate([signals, np.zeros((least - len(signals), signals.shape[1]))])
    bands = pywt.wavedec(signals, wavelet, mode="symmetric", level=level, axis=0)
    found = np.concatenate([band_statistics(band) for band in bands])  # ((level + 1) * 5, taxels)
    spatial = np.concatenate([found.mean(1), found.max(1), found.var(1)])
    return (spatial if reading == POOLED else np.concatenate([found.ravel(), spatial])).astype(np.float32)
