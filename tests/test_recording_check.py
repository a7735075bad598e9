"""What is no recording is refused, with its field named."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gestured.core.errors import RecordingError
from gestured.record.arrays import read, write
from tests.opening import NO_FILES, no_file
from tests.small_recording import FIELDS, example, refusal, same, save, session


def changed(name: str, index: Any, value: object) -> np.ndarray:
    array = np.array(getattr(session(), name))
    if array.dtype.kind == "U":
        array = array.astype("U80")
    array[index] = value
    return array


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("frames", np.zeros((10, 6), np.uint8), "expected the shape (N, R, C)"),
        ("frames", np.zeros((9, 2, 3), np.uint8), "expected the shape (9,), found (10,)"),
        ("frames", np.zeros((10, 1, 9), np.uint8), "R and C from 2 to 64, found (10, 1, 9)"),
        ("frames", np.zeros((10, 2, 65), np.uint8), "R and C from 2 to 64"),
        ("frames", np.full((10, 2, 3), 1e39), "recording 0: expected values that a float32 holds"),
        ("frames", np.zeros((10, 2, 3), complex), "complex128"),
        ("frames", np.full((10, 2, 3), np.nan), "recording 0: expected finite"),
        ("frames", np.where(np.arange(10)[:, None, None] == 6, np.inf, np.zeros((10, 2, 3))), "recording 1: expected"),
        ("times", np.zeros(9), "(10,)"),
        ("times", np.arange(10), "expected float64, found int64"),
        ("times", changed("times", 5, 0.0), "recording 1: expected strictly increasing"),
        ("times", changed("times", 2, np.nan), "recording 0: expected finite"),
        ("times", changed("times", 9, np.inf), "recording 1: expected finite"),
        ("times", 1e12 + np.arange(10), "recording 0: expected seconds, at most 1e+11"),
        ("offsets", np.array([0, 4, 10], np.int32), "expected int64, found int32"),
        ("offsets", np.array([1, 4, 10]), "from 0 to 10"),
        ("offsets", np.array([0, 4, 11]), "from 0 to 10"),
        ("offsets", np.array([0, 11, 10]), "recording 1: expected at least one frame"),
        ("offsets", np.array([0, 0, 10]), "recording 0: expected at least one frame"),
        ("offsets", np.array([], np.int64), "expected the shape (G + 1)"),
        ("labels", np.array(["one_tap"]), "(2,)"),
        ("labels", np.array([1, 2]), "text"),
        ("labels", changed("labels", 1, "One Tap"), "recording 1: expected 1 to 64"),
        ("labels", changed("labels", 0, "a" * 65), "recording 0"),
        ("labels", np.array(["\x7fffffff" * 3, "x"]), "recording 0"),
        ("subjects", np.array([[3], [4]]), "(2,)"),
        ("kinds", np.array([1, 2]), "text"),
        ("onsets", np.array([0.5, 1.0]), "integers"),
        ("onsets", np.array([-1, 0]), "recording 0: expected a frame within"),
        ("releases", np.array([3, 6]), "recording 1: expected a frame within"),
        ("releases", np.array([0, 5]), "recording 0: expected no frame before"),
        ("touches", None, "touch_ids: expected together with touches"),
        ("touch_ids", None, "together with touch_ids"),
        ("touches", np.full((10, 3, 2), np.nan), "float32"),
        ("touches", np.full((10, 2, 2), np.nan, np.float32), "(10, 3, 2)"),
        ("touches", np.full((10, 3, 2), np.nan, np.float32), "recording 1: expected NaN where"),
        ("touches", changed("touches", (5, 1, 0), np.inf), "recording 1: expected NaN where"),
        ("touches", changed("touches", (0, 0, 0), 1.0), "recording 0: expected NaN where"),
        ("touch_ids", changed("touch_ids", (0, 0), -2), "recording 0: expected -1"),
        ("consents", np.array(["2026-01-31", "soon"]), "recording 1: expected a day"),
        ("event_kinds", None, "together with event_kinds"),
        ("event_recording", np.array([0, 2, 1]), "event 1: expected 0 to 1"),
        ("event_labels", changed("event_labels", 2, "Swipe!"), "event 2: expected 1 to 64"),
        ("event_onsets", changed("event_onsets", 0, -0.1), "event 0: expected a time within"),
        ("event_offsets", changed("event_offsets", 2, 0.2), "event 2: expected a time from"),
    ],
)
def test_wrong_field_is_named(tmp_path: Path, name: str, value: np.ndarray | None, expected: str) -> None:
    message = refusal(save(tmp_path / "r.npz", session(), **{name: value}))
    assert expected in message
    others = ("times", "touches", "touch_ids", "offsets", "event_recording", "releases")  # that do not fit to it
    assert message.split(": ")[1].split(" of ")[0] in (name, *others)


@pytest.mark.parametrize("name", FIELDS[:5])
def test_missing_field_is_named(tmp_path: Path, name: str) -> None:
    assert f": {name}: is missing" in refusal(save(tmp_path / "r.npz", session(), **{name: None}))


def test_wrong_recordings_are_not_written(tmp_path: Path) -> None:
    path = tmp_path / "r.npz"
    write(path, example())
    before = path.read_bytes()
    with pytest.raises(RecordingError, match=r"r\.npz: not written: labels"):
        write(path, replace(example(), labels=np.array(["A", "B"])))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["r.npz"]


def test_members_that_are_not_known_are_left_alone(tmp_path: Path) -> None:
    same(read(save(tmp_path / "r.npz", example(), temperature=np.array([20.5]))), example())


def test_fortran_order_and_other_byte_order(tmp_path: Path) -> None:
    frames = np.asfortranarray(example().frames.astype(">i4"))
    found = read(save(tmp_path / "r.npz", example(), frames=frames, times=example().times.astype(">f8")))
    same(found, example())


class Surprise:
    """What a pickle would run."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (pytest.fail, ("unpickled",))


@pytest.mark.parametrize("name", ["frames", "labels", "kinds"])
def test_objects_are_never_unpickled(tmp_path: Path, name: str) -> None:
    objects = np.array([Surprise(), Surprise()], dtype=object)
    message = refusal(save(tmp_path / "r.npz", example(), **{name: objects}))
    assert f": {name}: " in message


@pytest.mark.parametrize("kind", NO_FILES)
def test_what_is_no_recording_file(tmp_path: Path, kind: str) -> None:
    refusal(no_file(kind, tmp_path / "r.npz"))
