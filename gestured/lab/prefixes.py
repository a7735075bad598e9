"""Unfinished gestures: windows that end while the finger is still down, as at run time.

A prefix ends in a touched frame, and is scaled by its own peak: nothing in it depends on what follows.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gestured.lab.samples import OF_EACH, WINDOW, Samples, packed
from gestured.model.features import ACTIVE


def askable(samples: Samples) -> NDArray[np.bool_]:
    """(N,) whether each frame of the samples is touched, so that a provisional answer may be asked for.

    Such a frame lies between the first and the last touched frame, and is active by the peak so far.
    """
    peaks = samples.frames.max(axis=(1, 2)).astype(np.float32) if len(samples.frames) else np.zeros(0, np.float32)
    found = np.zeros(len(peaks), bool)
    for i in range(len(samples)):
        begin = int(samples.offsets[i])
        touched = slice(begin + int(samples.first[i]), begin + int(samples.last[i]) + 1)
        found[touched] = peaks[touched] >= ACTIVE * np.maximum.accumulate(peaks[touched])
    return found


def floors(samples: Samples) -> NDArray[np.float32]:
    """(G,) the least peak by which each sample's prefixes are divided, in units of its window's values."""
    return (WINDOW.floor / np.maximum(samples.strength, WINDOW.floor)).astype(np.float32)


def shortened(x: Tensor, lengths: Tensor, least: Tensor) -> Tensor:
    """(B, T, R, C) windows, cut to `lengths` (B,) and scaled by their peak so far, at least by `least` (B,)."""
    kept = (torch.arange(x.shape[1])[None, :] < lengths[:, None]).to(x.dtype)
    x = x * kept[:, :, None, None]
    peak = torch.maximum(x.amax((1, 2, 3)), least)
    return x / peak[:, None, None, None]


def drawn(
    index: NDArray[np.int64], samples: Samples, asked: NDArray[np.bool_], share: float, rng: np.random.Generator
) -> NDArray[np.int64]:
    """(B,) for each sample of `index` the length of a random prefix, or 0 if it stays whole.

    `asked` is what `askable` gave. All lengths from the second touched frame on are equally likely.
    """
    lengths = np.zeros(len(index), np.int64)
    for row in np.flatnonzero(rng.random(len(index)) < share):
        i = index[row]
        ends = np.flatnonzero(asked[samples.offsets[i] : samples.offsets[i + 1]])[1:]
        if len(ends):
            lengths[row] = rng.choice(ends) + 1
    return lengths


def prefixes(samples: Samples) -> tuple[Samples, NDArray[np.int64], NDArray[np.int64]]:
    """All prefixes of the samples, in order; the sample of each, and its number of frames since the onset."""
    asked, least = askable(samples), floors(samples)
    windows: list[NDArray[np.float16]] = []
    of: list[int] = []
    since: list[int] = []
    for i in range(len(samples)):
        begin, stop = int(samples.offsets[i]), int(samples.offsets[i + 1])
        whole = samples.frames[begin:stop].astype(np.float32)
        for end in np.flatnonzero(asked[begin:stop]):
            part = whole[: end + 1]
            windows.append((part / max(float(part.max()), float(least[i]))).astype(np.float16))
            of.append(i)
            since.append(int(end) - int(samples.first[i]))
    index = np.array(of, np.int64)
    each = {name: getattr(samples, name)[index] for name in OF_EACH}
    frames, offsets = packed(windows)
    return Samples(frames, offsets, **each | {"last": np.diff(offsets) - 1}), index, np.array(since, np.int64)
