"""What a cell learns from: gestures, Algorithm 1's copies of them, and strangers on random sensors."""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gestured.lab.dataset import Samples, join
from gestured.lab.study.shifting import THRESHOLD, copies
from gestured.simulator import GESTURES

UNCHANGED, SHIFT, WIDE = "none", "shift", "wide"
AUGMENTATIONS = (UNCHANGED, SHIFT, WIDE)


@dataclass(frozen=True)
class Data:
    """A set of gestures. Two are equal where their keys are, so that a process prepares each once."""

    key: str  # a digest of all of it
    name: str = field(compare=False)  # simulated, real or own
    gestures: Samples = field(compare=False)
    wide: Samples | None = field(compare=False, default=None)  # other people on randomised sensors: to learn from only

    @classmethod
    def of(cls, name: str, gestures: Samples, wide: Samples | None = None) -> "Data":
        """With the key that belongs to it."""
        return cls(gestures.digest()[:16] + (wide.digest()[:8] if wide else ""), name, gestures, wide)


@dataclass(frozen=True)
class Pool:
    """Everything that a cell may learn from or be judged on; G gestures first, then what augmentation adds."""

    samples: Samples
    labels: NDArray[np.int64]  # class of each
    source: NDArray[np.int64]  # the gesture that it was made of; -1 for strangers
    same: NDArray[np.bool_]  # whether it is that gesture itself, by a shift of zero
    gestures: int  # G


def classes(samples: Samples) -> NDArray[np.int64]:
    """(G,) index into `GESTURES` of each; every sample must be a gesture."""
    place = {name: k for k, name in enumerate(GESTURES)}
    return np.array([place[str(label)] for label in samples.labels], np.int64)


def equal_length(samples: Samples, frames: int) -> Samples:
    """Every window cut, or followed by zeros, to so many frames: what the paper does before anything else."""
    out = np.zeros((len(samples), frames, *samples.frames.shape[1:]), samples.frames.dtype)
    for i in range(len(samples)):
        window = samples.frames[samples.offsets[i] : samples.offsets[i + 1]][:frames]
        out[i, : len(window)] = window
    return replace(
        samples, frames=out.reshape(-1, *out.shape[2:]), offsets=np.arange(len(samples) + 1, dtype=np.int64) * frames
    )


@lru_cache(maxsize=4)
def pool(data: Data, augmentation: str, frames: int = 0, box: float = THRESHOLD) -> Pool:
    """The gestures with what an augmentation adds; of equal length where `frames` is not 0.

    `box` is the threshold of Algorithm 1's bounding box.
    """
    count = len(data.gestures)
    parts, source, same = [data.gestures], np.arange(count), np.ones(count, bool)
    if augmentation == SHIFT:
        made = copies(data.gestures, box)
        parts, source, same = [*parts, made.samples], np.append(source, made.source), np.append(same, made.same)
    elif augmentation == WIDE:
        assert data.wide is not None
        strangers = len(data.wide)
        parts.append(data.wide)
        source, same = np.append(source, np.full(strangers, -1)), np.append(same, np.zeros(strangers, bool))
    samples = join(parts)
    if frames:
        samples = equal_length(samples, frames)
    return Pool(samples, classes(samples), source, same, count)
