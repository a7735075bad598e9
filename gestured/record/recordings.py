"""Recordings in memory: the fields of the contract, and methods that read them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.frames import Frame, Touch

FINGERS = 3  # of one frame, at most
EVENT = "event_"  # prefix of the fields about the performances in a session


@dataclass(frozen=True, eq=False)
class Recordings:
    """G recordings of one grid, N frames in all; `len` is G. Fields as in the contract; None if not known."""

    frames: NDArray[Any]  # (N, R, C) raw counts
    times: NDArray[np.float64]  # (N,) s, strictly increasing within a recording
    offsets: NDArray[np.int64]  # (G+1,) recording g is frames[offsets[g]:offsets[g+1]]
    labels: NDArray[np.str_]  # (G,) a gesture, "none" or "session"
    subjects: NDArray[Any]  # (G,) numbers or names
    speeds: NDArray[Any] | None = None  # (G,) numbers or names
    inclinations: NDArray[Any] | None = None  # (G,) numbers or names
    kinds: NDArray[np.str_] | None = None  # (G,) a finer name than the label
    onsets: NDArray[np.integer[Any]] | None = None  # (G,) frame within the recording: first touched
    releases: NDArray[np.integer[Any]] | None = None  # (G,) frame within the recording: last touched
    touches: NDArray[np.float32] | None = None  # (N, 3, 2) x, y; NaN for no finger
    touch_ids: NDArray[np.int32] | None = None  # (N, 3), -1 for no finger
    event_recording: NDArray[np.integer[Any]] | None = None  # (E,) the recording of each performance
    event_labels: NDArray[np.str_] | None = None  # (E,) as `labels`
    event_kinds: NDArray[np.str_] | None = None  # (E,) as `kinds`
    event_onsets: NDArray[np.float64] | None = None  # (E,) s on the recording's times
    event_offsets: NDArray[np.float64] | None = None  # (E,) s
    sensors: NDArray[np.str_] | None = None  # (G,) the kind of sensor, such as "touchscreen"; "" if not known
    consents: NDArray[np.str_] | None = None  # (G,) day of the participant's consent, YYYY-MM-DD; "" if not known

    def __len__(self) -> int:
        return len(self.labels)

    def frames_of(self, i: int) -> NDArray[Any]:
        """(T, R, C) raw counts of recording i. Raises IndexError if there is none."""
        return self.frames[self._span(i)]

    def times_of(self, i: int) -> NDArray[np.float64]:
        """(T,) times in s of recording i. Raises IndexError if there is none."""
        return self.times[self._span(i)]

    def stream(self, i: int) -> Iterator[Frame]:
        """The frames of recording i, as the front end takes them, with their touches."""
        span = self._span(i)
        for n in range(span.start, span.stop):
            touches: tuple[Touch, ...] = ()
            if self.touches is not None and self.touch_ids is not None:
                touches = touches_of(self.touch_ids[n], self.touches[n])
            yield Frame(float(self.times[n]), self.frames[n], touches)

    def take(self, chosen: Sequence[int] | NDArray[np.integer[Any]]) -> "Recordings":
        """The chosen recordings, each at most once, in that order, with their frames and events."""
        index = np.asarray(chosen, np.int64)
        lengths = np.diff(self.offsets)[index]
        spans = [np.arange(self.offsets[i], self.offsets[i + 1]) for i in index]
        of_frames = np.concatenate(spans) if spans else index
        place = np.full(len(self), -1, np.int64)
        place[index] = np.arange(len(index))
        events = slice(0) if self.event_recording is None else place[self.event_recording] >= 0
        rows = {"frames": of_frames, "times": of_frames, "touches": of_frames, "touch_ids": of_frames}
        taken = {
            field: value[events if field.startswith(EVENT) else rows.get(field, index)]
            for field, value in self.present()
        }
        taken["offsets"] = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
        if self.event_recording is not None:
            taken["event_recording"] = place[taken["event_recording"]]
        return Recordings(**taken)

    def present(self) -> Iterator[tuple[str, NDArray[Any]]]:
        """The fields that are known, each with its name."""
        return ((f.name, value) for f in fields(self) if (value := getattr(self, f.name)) is not None)

    def _span(self, i: int) -> slice:
        if not -len(self) <= i < len(self):
            raise IndexError(f"recording {i} of {len(self)}")
        return slice(int(self.offsets[i % len(self)]), int(self.offsets[i % len(self) + 1]))


def touch_arrays(frames: Sequence[Frame]) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """The fields `touches` (N, 3, 2) and `touch_ids` (N, 3) of N frames; `touches_of` reverts this for one frame."""
    touches = np.full((len(frames), FINGERS, 2), np.nan, np.float32)
    ids = np.full((len(frames), FINGERS), -1, np.int32)
    for n, frame in enumerate(frames):
        for k, touch in enumerate(frame.touches[:FINGERS]):
            if touch.id >= 0:
                touches[n, k], ids[n, k] = (touch.x, touch.y), touch.id
    return touches, ids


def touches_of(ids: NDArray[np.int32], places: NDArray[np.float32]) -> tuple[Touch, ...]:
    """The fingers of one frame: ids (3,), -1 for none, and their places (3, 2)."""
    return tuple(Touch(int(k), float(x), float(y)) for k, (x, y) in zip(ids, places, strict=True) if k >= 0)
