"""Small recordings, and what tests do with them."""

import io
import zipfile
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from gestured.core.errors import RecordingError
from gestured.record.arrays import read
from gestured.record.judge import NONE
from gestured.record.recordings import Recordings

FIELDS = [field.name for field in fields(Recordings)]


def example() -> Recordings:
    """Two cut gestures of four and six frames, with everything that is optional but events."""
    n = 10
    touches = np.full((n, 3, 2), np.nan, np.float32)
    ids = np.full((n, 3), -1, np.int32)
    touches[5, 1], ids[5, 1] = (2.0, 1.5), 7
    return Recordings(
        frames=np.arange(n * 6, dtype=np.uint8).reshape(n, 2, 3),
        times=np.array([0.0, 0.1, 0.2, 0.3, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5]),
        offsets=np.array([0, 4, 10]),
        labels=np.array(["one_tap", "none"]),
        subjects=np.array([3, 4]),
        speeds=np.array(["fast", "slow"]),
        inclinations=np.array([0.0, 45.0]),
        kinds=np.array(["tap, short", "palm"]),
        onsets=np.array([1, 0]),
        releases=np.array([2, 5]),
        touches=touches,
        touch_ids=ids,
        consents=np.array(["2026-01-31", ""]),
    )


def session() -> Recordings:
    """The same frames as two sessions with three events."""
    return replace(
        example(),
        labels=np.array(["session", "session"]),
        event_recording=np.array([1, 0, 1]),
        event_labels=np.array(["one_tap", "none", "swipe_up"]),
        event_kinds=np.array(["tap", "palm", "swipe"]),
        event_onsets=np.array([0.0, 0.1, 0.3]),
        event_offsets=np.array([0.1, 0.3, 0.5]),
    )


def untouched(times: np.ndarray) -> Recordings:
    """One of a sensor of 9 x 9 that nobody touches."""
    frames, offsets = np.zeros((len(times), 9, 9), np.uint8), np.array([0, len(times)])
    return Recordings(frames, times, offsets, labels=np.array([NONE]), subjects=np.array([0]))


def same(one: Recordings, other: Recordings) -> None:
    for name in FIELDS:
        a, b = getattr(one, name), getattr(other, name)
        assert (a is None) == (b is None), name
        if a is not None:
            np.testing.assert_array_equal(a, b, err_msg=name)


def refusal(path: Path) -> str:
    with pytest.raises(RecordingError) as caught:
        read(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


def save(path: Path, recordings: Recordings, **changes: object) -> Path:
    """As np.savez would, unchecked; None leaves a field out."""
    arrays = {name: getattr(recordings, name) for name in FIELDS} | changes
    np.savez(path, allow_pickle=True, **{k: v for k, v in arrays.items() if v is not None})
    return path


def archive_of(path: Path, **members: bytes) -> Path:
    """The example as an archive with these members more, or others."""
    save(path, example())
    with zipfile.ZipFile(path) as archive:
        held = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in (held | members).items():
            archive.writestr(name, data)
    return path


def header(dtype: str, shape: tuple[int, ...]) -> bytes:
    """What stands before an array's values in an .npy member."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": dtype, "fortran_order": False, "shape": shape})
    return buffer.getvalue()
