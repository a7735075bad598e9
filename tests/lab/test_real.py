"""The rows of real recordings: each gesture counts once, and those that were never cut out count as lost."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gestured.core.errors import GesturedError, RecordingError
from gestured.lab import train
from gestured.lab.evaluate import outcome
from gestured.lab.fit import targets
from gestured.lab.study.cohort import real
from gestured.record.arrays import write
from gestured.simulator import GESTURES, SimulatedSensor
from tests.lab.adapt.recorded import cut_gestures, whole_session


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four gestures, one of which nothing is to be seen of; and a session's file, which holds two of them again."""
    made = cut_gestures(("0", "1"), ("swipe_up", "one_tap"))
    frames = made.frames.copy()
    frames[made.offsets[1] : made.offsets[2]] = frames[made.offsets[1]]
    cut = replace(made, frames=frames, subjects=np.array([0, 0, 1, 1]), kinds=made.labels)
    again = replace(cut_gestures(("0",), ("swipe_up", "one_tap")), subjects=np.array([0, 0]), kinds=made.labels[:2])
    for name, recorded in zip(train.REAL_FILES, (cut, again), strict=True):
        write(tmp_path / name, recorded)
    return tmp_path


def test_a_folder_without_the_recordings_is_told(folder: Path) -> None:
    (folder / train.REAL_FILES[1]).unlink()
    with pytest.raises(RecordingError, match=f"{train.REAL_FILES[1]}: cannot be read"):
        train._real(folder, [])
    (folder / train.REAL_FILES[0]).unlink()
    with pytest.raises(RecordingError, match=f"{train.REAL_FILES[0]}: cannot be read"):
        real(folder, None)


def test_too_few_people_to_hold_one_out_are_refused(tmp_path: Path) -> None:
    paths = []
    for count, names in enumerate((("anna", "berta"), ("carla",)), 1):
        paths.append(tmp_path / f"{count}.npz")
        write(paths[-1], cut_gestures(names, GESTURES, repeats=2 // count, sensor=SimulatedSensor.nominal(day=count)))
    with pytest.raises(GesturedError, match=r"--recordings: expected gestures of at least 3 people, found 2"):
        train._real(None, paths[:1])
    found = train._real(None, paths)
    assert found is not None and [held.any() for held in train.folds(found[0])] == [True] * train.FOLDS


def test_what_was_never_cut_is_lost_and_what_is_in_both_files_counts_once(folder: Path) -> None:
    found = train._real(folder, [])
    assert found is not None
    samples, judged = found
    assert len(samples) == 5 and judged == 3
    performed = train._performed(folder, [])
    assert performed == {"taps and swipes": 4, "with non-gestures": 4}
    once = samples.take(np.arange(judged))
    surely = np.eye(10, dtype=np.float32)[targets(once)], np.zeros(judged, np.float32)
    result = outcome(surely, targets(once), 0.5, performed["taps and swipes"], once.people)
    assert (result.gestures, result.right, result.wrong, result.lost) == (4, 0.75, 0.0, 0.25)


def test_own_recordings_of_which_nothing_is_cut_out_count_as_performed(tmp_path: Path) -> None:
    made, session = cut_gestures(("0",), ("swipe_up", "circle_clockwise", "scribble")), whole_session("1")
    still = np.repeat(made.frames[:1], len(made.frames), axis=0)
    write(tmp_path / "cut.npz", replace(made, frames=still))
    write(tmp_path / "session.npz", session)
    assert session.event_labels is not None
    known = [label for label in session.event_labels.tolist() if label in GESTURES]
    strokes = [label for label in known if label == "one_tap" or label.startswith("swipe")]
    performed = train._performed(None, [tmp_path / "cut.npz", tmp_path / "session.npz"])
    assert performed == {"taps and swipes": 1 + len(strokes), "with non-gestures": 2 + len(known)}
