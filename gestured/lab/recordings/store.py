"""Recordings in the contract's form: of one take, or sets put together; and the touched frames of a gesture."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import RecordingError
from gestured.lab.dataset import cuts, with_idle
from gestured.lab.recordings.protocol import Exercise
from gestured.lab.recordings.quality import Captured
from gestured.record.check import EVENT_FIELDS
from gestured.record.recordings import FINGERS, Recordings, touch_arrays

TOGETHER = ("onsets", "releases")  # fields that are left out if one set lacks them


def join_recordings(parts: Sequence[Recordings]) -> Recordings:
    """Several sets as one, in that order. Raises RecordingError if their grids differ.

    A field that one set lacks is empty for its recordings (NaN for touches).
    """
    grids = {part.frames.shape[1:] for part in parts}
    if len(grids) != 1:
        raise RecordingError(f"frames: expected one grid, found {' and '.join(f'{r}x{c}' for r, c in sorted(grids))}")
    joined: dict[str, Any] = {}
    for field in (field.name for field in fields(Recordings)):
        known = [getattr(part, field) for part in parts]
        lack = [value is None for value in known]
        if field == "offsets" or all(lack) or (field in TOGETHER and any(lack)):
            continue
        if field not in EVENT_FIELDS:
            known = [
                _unknown(field, part) if value is None else value for part, value in zip(parts, known, strict=True)
            ]
        joined[field] = np.concatenate([value for value in known if value is not None])
    lengths = np.concatenate([np.diff(part.offsets) for part in parts])
    joined["offsets"] = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    if "event_recording" in joined:
        before = np.cumsum([0, *(len(part) for part in parts)])[:-1]
        numbers = zip((part.event_recording for part in parts), before, strict=True)
        joined["event_recording"] = np.concatenate([of + start for of, start in numbers if of is not None])
    return Recordings(**joined)


def _unknown(field: str, part: Recordings) -> NDArray[Any]:
    if field == "touches":
        return np.full((len(part.frames), FINGERS, 2), np.nan, np.float32)
    if field == "touch_ids":
        return np.full((len(part.frames), FINGERS), -1, np.int32)
    return np.full(len(part), "")


def compact(frames: NDArray[Any]) -> NDArray[Any]:
    """(T, R, C) counts as uint16 or int32 if they are whole numbers that fit, else float32, else as they are."""
    low, high = float(frames.min()), float(frames.max())
    if (frames == np.rint(frames)).all():
        for kind in (np.uint16, np.int32):
            if np.iinfo(kind).min <= low and high <= np.iinfo(kind).max:
                return frames.astype(kind)
    return frames.astype(np.float32) if max(-low, high) <= float(np.finfo(np.float32).max) else frames


def touched(frames: NDArray[Any], times: NDArray[np.float64]) -> tuple[int, int] | None:
    """The first and the last touched frame of one gesture (T, R, C) at `times` (T,) s, as the front end sees them.

    None if the front end does not see exactly one gesture. A recording that is touched too early for it to learn the
    idle sensor is extended by idle frames of its own, as for training; without any, the result is None.
    """
    rise = (frames - np.quantile(frames, 0.25, axis=0)).max(axis=(1, 2))
    strong = np.flatnonzero(rise >= 0.3 * rise.max())
    first, last = max(int(strong[0]) - 1, 0), int(strong[-1]) + 1
    tries = [(frames, times, 0)]
    if first > 1 or last + 3 < len(times):
        tries.append(with_idle(frames, times, first, last, 0))
    for values, stamps, lead in tries:
        found = cuts(values, stamps)
        if len(found) == 1:
            first, last = np.searchsorted(stamps, [found[0].onset, found[0].offset]) - lead
            if 0 <= first <= last < len(times):
                return int(first), int(last)
    return None


def recording(take: Captured, trial: Exercise, participant: str, consent: str, sensor: str = "") -> Recordings:
    """A take in the contract's form, times counted from its first frame; `sensor` is its kind."""
    times = take.times()
    touches, ids = touch_arrays(take.frames)
    return Recordings(
        frames=compact(np.array([frame.values for frame in take.frames])),
        times=times - times[0],
        offsets=np.array([0, len(times)], np.int64),
        labels=np.array([trial.label]),
        subjects=np.array([participant]),
        speeds=np.array([trial.speed]),
        inclinations=np.array([trial.inclination]),
        kinds=np.array([trial.gesture]),
        onsets=np.array([take.onset]),
        releases=np.array([take.release]),
        touches=touches,
        touch_ids=ids,
        sensors=np.array([sensor]) if sensor else None,
        consents=np.array([consent]),
    )
