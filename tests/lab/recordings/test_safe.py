"""Of a file that is partly bad, what is good is used, and what is not is told."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gestured.core.errors import RecordingError
from gestured.lab.recordings.safe import read_what_is_good
from gestured.record.arrays import read
from gestured.record.recordings import Recordings
from tests.small_recording import FIELDS, example, same, save, session
from tests.test_recording import any_recordings


def changed(of: Recordings, name: str, index: Any, value: object) -> np.ndarray:
    array = np.array(getattr(of, name))
    array = array.astype("U80") if array.dtype.kind == "U" else array
    array[index] = value
    return array


@pytest.mark.parametrize("of", [example, session])
def test_a_good_file_is_read_whole(of: Callable[[], Recordings], tmp_path: Path) -> None:
    found, left = read_what_is_good(save(tmp_path / "r.npz", of()))
    same(found, of())
    assert left == []


@pytest.mark.parametrize(
    ("name", "index", "value", "bad"),
    [
        ("times", 5, 0.0, 1),
        ("times", 2, np.nan, 0),
        ("labels", 1, "One Tap", 1),
        ("onsets", 0, -1, 0),
        ("releases", 1, 6, 1),
        ("touch_ids", (0, 0), -2, 0),
        ("event_onsets", 1, np.nan, 0),
        ("event_offsets", 2, 0.2, 1),
        ("consents", 1, "yesterday", 1),
    ],
)
def test_only_the_recording_that_is_wrong_is_left_out(
    name: str, index: object, value: object, bad: int, tmp_path: Path
) -> None:
    whole = session()
    path = save(tmp_path / "r.npz", whole, **{name: changed(whole, name, index, value)})
    found, (left,) = read_what_is_good(path)
    assert (left.file, left.recording, left.field) == (path, bad, name)
    assert str(left).startswith(f"{path}: recording {bad} is left out: {name}")
    assert "expected" in left.reason
    same(found, whole.take([1 - bad]))


@pytest.mark.parametrize(
    ("name", "value", "gone"),
    [
        ("speeds", np.array(["fast"]), {"speeds"}),
        ("kinds", np.array([1, 2]), {"kinds"}),
        ("onsets", np.array([0.5, 1.0]), {"onsets", "releases"}),
        ("touch_ids", None, {"touches", "touch_ids"}),
        ("touches", np.zeros((10, 3, 2)), {"touches", "touch_ids"}),
    ],
)
def test_a_field_that_nobody_needs_is_left_out_of_all(
    name: str, value: np.ndarray | None, gone: set[str], tmp_path: Path
) -> None:
    found, (left,) = read_what_is_good(save(tmp_path / "r.npz", example(), **{name: value}))
    assert left.recording is None
    assert left.field in gone
    same(found, replace(example(), **dict.fromkeys(gone)))


def test_a_damaged_member_that_nobody_needs_is_left_out(tmp_path: Path) -> None:
    path = save(tmp_path / "r.npz", example())
    content = bytearray(path.read_bytes())
    content[content.index(np.array(["fast", "slow"]).tobytes())] ^= 1  # the checksum no longer fits
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="speeds: is damaged"):
        read(path)
    found, (left,) = read_what_is_good(path)
    assert left.field == "speeds"
    same(found, replace(example(), speeds=None))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("frames", None),
        ("labels", np.array(["one_tap"])),
        ("offsets", np.array([0, 11, 10])),
        ("event_recording", np.array([0, 2, 1])),
        ("event_kinds", None),
        ("event_labels", np.array(["one_tap"])),
    ],
)
def test_where_nothing_can_be_told_the_file_is_refused(name: str, value: np.ndarray | None, tmp_path: Path) -> None:
    path = save(tmp_path / "r.npz", session(), **{name: value})
    with pytest.raises(RecordingError, match=f"r.npz: {name.split('_')[0]}"):
        read_what_is_good(path)


def test_a_recording_without_frames_is_left_out(tmp_path: Path) -> None:
    times = np.arange(10) / 10
    path = save(tmp_path / "r.npz", example(), times=times, offsets=np.array([0, 0, 10]), onsets=None, releases=None)
    found, (left,) = read_what_is_good(path)
    assert (left.recording, left.field, len(found)) == (0, "offsets", 1)
    np.testing.assert_array_equal(found.frames, example().frames)


@settings(deadline=None)
@given(any_recordings(), st.data())
def test_the_good_ones_are_untouched_by_the_bad(
    tmp_path_factory: pytest.TempPathFactory, recordings: Recordings, data: st.DataObject
) -> None:
    bad = sorted(data.draw(st.sets(st.integers(0, len(recordings) - 1)))) if len(recordings) else []
    labels = recordings.labels.astype("U80")
    labels[bad] = "No Label"
    path = save(tmp_path_factory.getbasetemp() / "some.npz", replace(recordings, labels=labels))
    found, left = read_what_is_good(path)
    assert [one.recording for one in left] == bad
    good = [i for i in range(len(recordings)) if i not in bad]
    assert len(found) == len(good)
    for k, i in enumerate(good):
        np.testing.assert_array_equal(found.frames_of(k), recordings.frames_of(i))
        np.testing.assert_array_equal(found.times_of(k), recordings.times_of(i))
        for name in FIELDS[3:8]:
            value = getattr(recordings, name)
            if value is not None:
                np.testing.assert_array_equal(getattr(found, name)[k], value[i])  # a speed may be NaN: nobody knows it
