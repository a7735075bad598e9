"""A researcher's own recordings: what is used, and what is left out and named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gestured.core.errors import GesturedError
from gestured.lab.study import cells
from gestured.lab.study.material import Data
from gestured.lab.study.own import own
from gestured.lab.study.protocols import Task
from gestured.record.arrays import write
from gestured.record.recordings import Recordings
from tests.lab.adapt.recorded import cut_gestures


def recordings(people: tuple[str, ...]) -> Recordings:
    """A swipe and a tap of each person, as a collector writes them."""
    return cut_gestures(people, ("swipe_up", "one_tap"))


def test_one_name_is_one_participant_across_files(tmp_path: Path) -> None:
    write(tmp_path / "a.npz", recordings(("anna", "07")))
    write(tmp_path / "b.npz", recordings(("anna",)))
    found = own([tmp_path / "a.npz", tmp_path / "b.npz"])
    assert found.samples is not None
    assert sorted(found.samples.people.tolist()) == [0, 0, 0, 0, 1, 1]
    assert [entry["used"] for entry in found.files] == [4, 2] and not found.left_out


def test_a_bad_recording_is_left_out_and_named_and_the_rest_is_used(tmp_path: Path) -> None:
    good = recordings(("anna", "berta", "carla"))
    labels = good.labels.astype("U40")
    labels[3] = "waving"
    times = good.times.copy()
    times[good.offsets[2] + 1] = np.nan
    path = tmp_path / "a.npz"
    bad = replace(good, labels=labels, times=times)
    np.savez(path, **{name: value for name, value in vars(bad).items() if value is not None})
    found = own([path])
    assert found.files == [{"file": str(path), "recordings": 6, "used": 4}]
    assert {(entry["recording"], entry["field"]) for entry in found.left_out} == {(2, "times"), (3, "labels")}
    assert all(str(path) == entry["file"] and entry["reason"] for entry in found.left_out)


def test_what_cannot_be_read_is_named_and_too_little_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "x.npz").write_text("no recording")
    write(tmp_path / "a.npz", recordings(("anna", "berta")))
    found = own([tmp_path / "x.npz", tmp_path / "a.npz"])
    assert found.left_out[0]["file"].endswith("x.npz") and len(found.files) == 2
    with pytest.raises(GesturedError, match=r"--recordings: expected .* at least 2 participants.*x\.npz"):
        own([tmp_path / "x.npz"])


def test_no_recordings_is_nothing() -> None:
    found = own([])
    assert found.samples is None and not found.files and not found.left_out


def test_too_few_people_end_in_a_sentence_that_names_them(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    write(tmp_path / "a.npz", recordings(("anna", "berta")))
    found = own([tmp_path / "a.npz"])
    assert found.samples is not None

    def fails(task: Task, data: Data) -> None:
        raise ValueError("This solver needs samples of at least 2 classes in the data,\nbut it has 1")

    monkeypatch.setattr(cells, "run", fails)
    task = Task("svm", (), "none", "participants", "own", 0, 2, 0)
    with pytest.raises(GesturedError, match=r"--recordings: 4 gestures of 2 people are too few for svm: .*has 1"):
        cells.compute(task, Data.of("own", found.samples))
    with pytest.raises(ValueError, match="at least 2 classes"):  # elsewhere it is a fault of ours
        cells.compute(replace(task, data="simulated"), Data.of("simulated", found.samples))
