"""The material of a cell: gestures, and Algorithm 1's copies of them."""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gestured.core.window import running_mean
from gestured.lab.samples import OF_EACH, Samples, join
from gestured.simulator import GESTURES

UNCHANGED, SHIFT = "none", "shift"
AUGMENTATIONS = (UNCHANGED, SHIFT)
JUDGE = -1  # stands for a gesture's index in samples that only judge
THRESHOLD = 0.2  # of the gesture's peak
EDGES = ("top", "bottom", "left", "right")


@dataclass(frozen=True)
class Data:
    """A set of gestures. Two are equal if their keys are, so that a process prepares each once."""

    key: str  # a digest of all samples
    gestures: Samples = field(compare=False)
    judges: Samples | None = field(compare=False, default=None)  # of another generator: they judge and teach nothing

    @classmethod
    def of(cls, gestures: Samples, judges: Samples | None = None) -> "Data":
        """A set with the key of its samples."""
        return cls(gestures.digest()[:16] + (judges.digest()[:8] if judges else ""), gestures, judges)


@dataclass(frozen=True)
class Form:
    """What is done to all windows before anything else; by default nothing."""

    frames: int = 0  # length to which each is cut, or followed by zeros; 0: each keeps its own
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
    offsets = np.arange(len(samples) + 1, dtype=np.int64) * frames
    return replace(samples, frames=out.reshape(-1, *out.shape[2:]), offsets=offsets)


def averaged(samples: Samples, count: int) -> Samples:
    """Every window as a running average over so many frames, with its peak at 1 again."""
    frames = samples.frames.copy()
    for i in range(len(samples)):
        span = slice(samples.offsets[i], samples.offsets[i + 1])
        smooth = running_mean(frames[span].astype(np.float64), count)
        frames[span] = smooth / max(float(smooth.max()), 1e-3)
    return replace(samples, frames=frames)


def bounding_box(window: NDArray[np.floating], threshold: float = THRESHOLD) -> tuple[int, int, int, int]:
    """(T, R, C) -> first row, last row, first column, last column that were pressed; all if none was."""
    rows, columns = window.shape[1:]
    pressed = window.max(axis=0) > threshold * window.max()
    if not pressed.any():
        return 0, rows - 1, 0, columns - 1
    down, across = np.flatnonzero(pressed.any(axis=1)), np.flatnonzero(pressed.any(axis=0))
    return int(down[0]), int(down[-1]), int(across[0]), int(across[-1])


def shifts(window: NDArray[np.floating], threshold: float = THRESHOLD) -> list[tuple[int, int]]:
    """(rows, columns) to move a gesture by, for each of `EDGES`."""
    rows, columns = window.shape[1:]
    top, bottom, left, right = bounding_box(window, threshold)
    return [(-top, 0), (rows - 1 - bottom, 0), (0, -left), (0, columns - 1 - right)]


def shifted(window: NDArray[np.floating], rows: int, columns: int) -> NDArray[np.floating]:
    """A window (T, R, C) moved by whole taxels; what leaves the sensor is lost, what comes in is zero."""

    def span(size: int, by: int) -> slice:
        return slice(max(by, 0), size + min(by, 0))

    height, width = window.shape[1:]
    out = np.zeros_like(window)
    out[:, span(height, rows), span(width, columns)] = window[:, span(height, -rows), span(width, -columns)]
    return out


def copies(samples: Samples, threshold: float = THRESHOLD) -> tuple[Samples, NDArray[np.int64], NDArray[np.bool_]]:
    """The paper's augmentation, Algorithm 1: each of G gestures again at the edges of the sensor.

    The bounding box of a gesture holds every taxel that was pressed in any of its frames. The whole gesture is moved up
    until its box touches the top edge, and again for the bottom, the left and the right edge: four copies of each. If
    the box touches an edge already, the shift is zero and the copy is the gesture itself. The paper neither mentions
    such copies nor leaves them out; we keep them and count them.

    The paper leaves open from which pressure on a taxel belongs to the box. Ours is `THRESHOLD` of the gesture's peak.
    With a threshold of zero, noise fills the frame and every copy is the gesture itself.

    Returns 4 G samples, edge by edge; (4 G,) the gesture that each was made of; (4 G,) whether the shift was zero.
    """
    count, edges = len(samples), len(EDGES)
    frames = np.zeros((edges, *samples.frames.shape), samples.frames.dtype)
    same = np.zeros((edges, count), bool)
    for i in range(count):
        span = slice(samples.offsets[i], samples.offsets[i + 1])
        window = samples.frames[span]
        for edge, (rows, columns) in enumerate(shifts(window, threshold)):
            frames[edge, span] = shifted(window, rows, columns)
            same[edge, i] = rows == columns == 0
    starts = np.concatenate([samples.offsets[:-1] + edge * samples.offsets[-1] for edge in range(edges)])
    made = Samples(
        frames.reshape(-1, *frames.shape[2:]),
        np.append(starts, edges * samples.offsets[-1]).astype(np.int64),
        *(np.concatenate([getattr(samples, name)] * edges) for name in OF_EACH),
    )
    return made, np.tile(np.arange(count), edges), same.ravel()


@lru_cache(maxsize=4)
def pool(data: Data, augmentation: str, form: Form = NO_FORM, box: float = THRESHOLD) -> Pool:
    """The gestures with what an augmentation adds, all in one form, and the samples that only judge.

    `box` is the threshold of Algorithm 1's bounding box.
    """
    count = len(data.gestures)
    gestures = averaged(data.gestures, form.average) if form.average > 1 else data.gestures
    parts, source, same = [gestures], np.arange(count), np.ones(count, bool)
    if augmentation == SHIFT:
        made, made_of, unmoved = copies(gestures, box)
        parts, source, same = [*parts, made], np.append(source, made_of), np.append(same, unmoved)
    if data.judges is not None:
        parts.append(data.judges)
        source = np.append(source, np.full(len(data.judges), JUDGE))
        same = np.append(same, np.zeros(len(data.judges), bool))
    samples = join(parts)
    if form.frames:
        samples = equal_length(samples, form.frames)
    return Pool(samples, classes(samples), source, same, count)
