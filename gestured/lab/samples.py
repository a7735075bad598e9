"""Samples: windows and what is known of them, from which everything in the lab learns."""

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.frames import Segment
from gestured.core.window import Window
from gestured.model.context import NAMES, context
from gestured.model.features import touch_pattern

EVERYDAY, LIKE_A_TAP, PART = "everyday", "like_a_tap", "part"  # kinds of segments that are cut out of everyday life
# The window of every model.
WINDOW = Window(rows=9, columns=9, rate_hz=15.0, smooth_frames=1, lead_s=1 / 15, tail_s=1 / 15, floor=4.0)


@dataclass(frozen=True, slots=True)
class Samples:
    """G windows of varying length with what is known of them."""

    frames: NDArray[np.float16]  # (N, R, C), one after the other
    offsets: NDArray[np.int64]  # (G + 1,)
    labels: NDArray[np.str_]  # (G,) gesture or "none"
    kinds: NDArray[np.str_]  # (G,) the finer name
    people: NDArray[np.int64]  # (G,) participant or subject
    strength: NDArray[np.float64]  # (G,) peak in units of the sensor's noise
    first: NDArray[np.int64]  # (G,) index of the first touched frame in its window
    last: NDArray[np.int64]  # (G,) index of the last touched frame
    context: NDArray[np.float32]  # (G, K) context of each (`gestured.model.context`)

    def __len__(self) -> int:
        return len(self.labels)

    def window(self, index: int) -> NDArray[np.float32]:
        """(T, R, C) window of one sample."""
        return self.frames[self.offsets[index] : self.offsets[index + 1]].astype(np.float32)

    def lengths(self) -> NDArray[np.int64]:
        """(G,) number of frames of each window."""
        return np.diff(self.offsets)

    def alike(self, most: int) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float32]]]:
        """At most so many windows (n, T, R, C) of one length, and their indices (n,): a padded one would seem over."""
        lengths = self.lengths()
        for length in np.unique(lengths):
            same = np.flatnonzero(lengths == length)
            for index in np.array_split(same, -(-len(same) // most)):
                yield index, np.stack([self.window(int(i)) for i in index])

    def features(self) -> NDArray[np.float32]:
        """(G, F) touch-pattern features."""
        return np.stack([touch_pattern(self.window(i), WINDOW.rate_hz) for i in range(len(self))])

    def take(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> "Samples":
        """The chosen samples, in that order."""
        index = np.flatnonzero(chosen) if chosen.dtype == bool else chosen
        parts = [self.frames[self.offsets[i] : self.offsets[i + 1]] for i in index]
        return Samples(*packed(parts), *(getattr(self, name)[index] for name in OF_EACH))

    def digest(self) -> str:
        """The SHA-256 of frames, offsets, labels, kinds and people; the other fields do not count."""
        total = hashlib.sha256()
        for array in (self.frames, self.offsets, self.labels.astype("U40"), self.kinds.astype("U40"), self.people):
            total.update(np.ascontiguousarray(array).tobytes())
        return total.hexdigest()


OF_EACH = Samples.__slots__[2:]  # the fields (G,)
# numpy types of the fields in `OF_EACH`, but for the last, the context.
DTYPES = ("U40", "U40", "int64", "float64", "int64", "int64")


def packed(windows: Sequence[NDArray[np.float16]]) -> tuple[NDArray[np.float16], NDArray[np.int64]]:
    """(N, R, C) frames of windows, one after the other, and (G + 1,) where each begins and the last one ends."""
    frames = np.concatenate(windows) if windows else np.zeros((0, WINDOW.rows, WINDOW.columns), np.float16)
    return frames, np.cumsum([0, *map(len, windows)], dtype=np.int64)


class Sample(NamedTuple):
    """One window, with what `Samples` holds of each."""

    window: NDArray[np.float16]
    label: str
    kind: str
    person: int
    strength: float
    first: int
    last: int
    context: NDArray[np.float32]


def sample(segment: Segment, label: str, kind: str, person: int, window: Window = WINDOW) -> Sample:
    """The sample of a segment, seen through a window."""
    signed = window.signed(segment)
    frames = np.maximum(signed, 0.0).astype(np.float16)
    strength = float(segment.frames[segment.first : segment.last + 1].max()) / max(segment.noise, 1e-30)
    begin = segment.times[window.span(segment)[0]]
    first, last = (min(round((t - begin) * window.rate_hz), len(frames) - 1) for t in (segment.onset, segment.offset))
    return Sample(frames, label, kind, person, strength, first, last, context(segment, signed, window))


def collect(samples: Iterable[Sample]) -> Samples:
    """Put single samples together."""
    found = list(samples)
    each: list[NDArray[Any]] = [np.array([s[k] for s in found], dtype=dtype) for k, dtype in enumerate(DTYPES, 1)]
    each.append(np.array([s.context for s in found], np.float32).reshape(len(found), len(NAMES)))
    return Samples(*packed([s.window for s in found]), *each)


def join(parts: Sequence[Samples]) -> Samples:
    """Several sets as one."""
    starts = np.cumsum([0] + [int(p.offsets[-1]) for p in parts])
    offsets = [p.offsets[:-1] + start for p, start in zip(parts, starts, strict=False)]
    return Samples(
        np.concatenate([p.frames for p in parts]),
        np.concatenate([*offsets, starts[-1:]]).astype(np.int64),
        *(np.concatenate([getattr(p, name) for p in parts]) for name in OF_EACH),
    )
