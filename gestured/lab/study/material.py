"""What a cell learns from: gestures, and Algorithm 1's copies of them."""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gestured.core.window import running_mean
from gestured.lab.samples import Samples, join
from gestured.lab.study.shifting import THRESHOLD, copies
from gestured.simulator import GESTURES

UNCHANGED, SHIFT = "none", "shift"
AUGMENTATIONS = (UNCHANGED, SHIFT)
JUDGE = -1  # stands for a gesture's index: of other people, who judge alone


@dataclass(frozen=True)
class Data:
    """A set of gestures. Two are equal where their keys are, so that a process prepares each once."""

    key: str  # a digest of all of it
    name: str = field(compare=False)  # simulated, real or foreign
    gestures: Samples = field(compare=False)
    judges: Samples | None = field(compare=False, default=None)  # of another generator: they judge and teach nothing

    @classmethod
    def of(cls, name: str, gestures: Samples, judges: Samples | None = None) -> "Data":
        """With the key that belongs to it."""
        return cls(gestures.digest()[:16] + (judges.digest()[:8] if judges else ""), name, gestures, judges)


@dataclass(frozen=True)
class Form:
    """What is done to all windows before anything else: nothing, unless told."""

    frames: int = 0  # each is cut, or followed by zeros, to so many; 0: each keeps its own
    average: int = 1  # frames of a running average, after which a window has its peak at 1 again


NO_FORM = Form()


@dataclass(frozen=True)
class Pool:
    """Everything that a cell may learn from or be judged on; G gestures first, then what augmentation adds."""

    samples: Samples
    labels: NDArray[np.int64]  # class of each
    source: NDArray[np.int64]  # the gesture that it was made of, or `JUDGE`
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


def averaged(samples: Samples, count: int) -> Samples:
    """Every window as a running average over so many frames, with its peak at 1 again."""
    frames = samples.frames.copy()
    for i in range(len(samples)):
        span = slice(samples.offsets[i], samples.offsets[i + 1])
        smooth = running_mean(frames[span].astype(np.float64), count)
        frames[span] = smooth / max(float(smooth.max()), 1e-3)
    return replace(samples, frames=frames)


@lru_cache(maxsize=4)
def pool(data: Data, augmentation: str, form: Form = NO_FORM, box: float = THRESHOLD) -> Pool:
    """The gestures with what an augmentation adds, all in one form, and those who judge alone.

    `box` is the threshold of Algorithm 1's bounding box.
    """
    count = len(data.gestures)
    gestures = averaged(data.gestures, form.average) if form.average > 1 else data.gestures
    parts, source, same = [gestures], np.arange(count), np.ones(count, bool)
    if augmentation == SHIFT:
        made = copies(gestures, box)
        parts, source, same = [*parts, made.samples], np.append(source, made.source), np.append(same, made.same)
    if data.judges is not None:
        parts.append(data.judges)
        source = np.append(source, np.full(len(data.judges), JUDGE))
        same = np.append(same, np.zeros(len(data.judges), bool))
    samples = join(parts)
    if form.frames:
        samples = equal_length(samples, form.frames)
    return Pool(samples, classes(samples), source, same, count)
