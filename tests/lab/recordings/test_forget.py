"""`gestured-lab forget`: whoever is forgotten is gone, everybody else is untouched, and models are asked."""

import errno
import json
import os
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gestured.lab.recordings.origin import origins
from gestured.lab.recordings.store import join_recordings
from gestured.record.arrays import read, write
from tests.lab.conftest import Run
from tests.small_recording import example, same, save, session


def of(*subjects: str):
    return replace(session(), subjects=np.array(subjects))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A folder with recordings of 07, of 07 and 08, and of 08 and 70."""
    write(tmp_path / "07.npz", of("07", "07"))
    write(tmp_path / "both.npz", of("07", "08"))
    write(tmp_path / "08.npz", of("08", "70"))
    return tmp_path


@pytest.fixture
def forget(run: Run) -> Run:
    """`gestured-lab forget`: exit status, standard output, standard error."""
    return partial(run, "forget")


def contents(path: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in path.iterdir()}


def test_whoever_is_forgotten_is_gone_and_nobody_else(path: Path, forget: Run) -> None:
    other = (path / "08.npz").read_bytes()
    status, out, _ = forget("07", path, "--yes")
    assert status == 0
    assert f"{path / '07.npz'}: 2 of 2 recordings" in out
    assert f"{path / 'both.npz'}: 1 of 2 recordings" in out
    assert "removed; not looked for" in out
    assert contents(path).keys() == {"both.npz", "08.npz"}
    same(read(path / "both.npz"), of("07", "08").take([1]))
    assert (path / "08.npz").read_bytes() == other
    assert "no recording of 07 was found" in forget("07", path, "--yes")[1]


def test_links_and_what_a_power_cut_left_behind_are_looked_into(tmp_path: Path, forget: Run) -> None:
    kept, links = tmp_path / "kept", tmp_path / "links"
    kept.mkdir()
    links.mkdir()
    write(kept / "07.npz", of("07", "08"))
    (links / "linked.npz").symlink_to(kept / "07.npz")
    write(links / "x.npz", of("07", "07"))
    (links / "x.npz").rename(links / ".x.npz.4711")
    assert forget("07", links, "--yes")[0] == 0
    assert (links / "linked.npz").is_symlink()
    assert read(kept / "07.npz").subjects.tolist() == ["08"]
    assert not (links / ".x.npz.4711").exists()


def test_folders_that_are_linked_or_cannot_be_read_are_not_passed_over(
    tmp_path: Path, forget: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk, path, scan = tmp_path / "disk", tmp_path / "recordings", os.scandir
    (path / "locked").mkdir(parents=True)
    disk.mkdir()
    write(disk / "07.npz", of("07", "07"))
    (path / "linked").symlink_to(disk)
    (disk / "back").symlink_to(path)

    def refused(folder: Any) -> Any:
        if Path(folder).name == "locked":
            raise PermissionError(errno.EACCES, "Permission denied", str(folder))
        return scan(folder)

    monkeypatch.setattr(os, "scandir", refused)
    status, out, _ = forget("07", path, "--yes")
    assert (status, out.count(f"{disk / '07.npz'}: 2 of 2 recordings\n")) == (1, 1)
    assert f"not looked into: {path / 'locked'}: Permission denied\n" in out
    assert not (disk / "07.npz").exists()


def test_a_person_whom_the_recordings_call_by_a_name_is_forgotten(tmp_path: Path, forget: Run) -> None:
    write(tmp_path / "named.npz", of("Ada Löwe", "08"))
    assert forget("Ada Löwe", tmp_path, "--yes")[0] == 0
    assert read(tmp_path / "named.npz").subjects.tolist() == ["08"]


def test_a_participant_of_another_spelling_stays_and_is_told(path: Path, forget: Run) -> None:
    before = contents(path)
    out = forget("7", path, "--yes")[1]
    assert "no recording of 7 was found\nrecordings of '07' stay: is that the same participant?\n" in out
    assert contents(path) == before and "stay" not in forget("07", path, "--yes")[1]


def test_numbers_as_subjects_are_found_too(tmp_path: Path, forget: Run) -> None:
    write(tmp_path / "numbers.npz", example())
    assert forget("3", tmp_path / "numbers.npz", "--yes")[0] == 0
    assert read(tmp_path / "numbers.npz").subjects.tolist() == [4]


@pytest.mark.parametrize("answer", ["no\n", "y\n", "\n", ""])
def test_without_a_yes_nothing_is_removed(
    answer: str, path: Path, forget: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = contents(path)
    monkeypatch.setattr(sys, "stdin", Typed(answer))
    status, out, _ = forget("07", path)
    assert (status, contents(path)) == (0, before)
    assert "nothing was removed" in out


class Typed:
    """A person at a terminal."""

    def __init__(self, answer: str) -> None:
        self.answer = answer

    def isatty(self) -> bool:
        return True

    def readline(self) -> str:
        return self.answer


def test_a_yes_removes(path: Path, forget: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", Typed("yes\n"))
    assert "removed; not looked for" in forget("07", path)[1]
    assert contents(path).keys() == {"both.npz", "08.npz"}


def test_a_dry_run_and_a_missing_terminal_remove_nothing(path: Path, forget: Run) -> None:
    before = contents(path)
    status, out, _ = forget("07", path, "--dry-run", "--json")
    assert status == 0
    said = json.loads(out)
    assert (said["removed"], [file["recordings"] for file in said["files"]]) == (False, [2, 1])
    status, _, err = forget("07", path)
    assert (status, "expected --yes or --dry-run" in err) == (1, True)
    assert forget("07", path, path / "nowhere", "--yes")[0] == 1
    assert contents(path) == before


def test_what_cannot_be_looked_into_or_kept_whole_is_told(path: Path, forget: Run) -> None:
    (path / "damaged.npz").write_bytes(b"no recording")
    extra = save(path / "extra.npz", of("07", "08"), temperature=np.array([20.0]))
    before = extra.read_bytes()
    status, out, _ = forget("07", path, "--yes")
    assert status == 1
    assert f"not looked into: {path / 'damaged.npz'}: cannot be read" in out
    assert f"not looked into: {extra}: temperature.npy: is no field" in out
    assert extra.read_bytes() == before
    assert not (path / "07.npz").exists()  # what can be removed is


def test_a_file_that_cannot_be_removed_is_told_and_keeps_no_other(
    path: Path, forget: Run, monkeypatch: pytest.MonkeyPatch
) -> None:

    def refused(file: Path) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(file))

    monkeypatch.setattr(Path, "unlink", refused)
    status, out, err = forget("07", path, "--yes", "--models", "nowhere")
    assert (status, err) == (1, f"not removed: {path / '07.npz'}: Permission denied\n")
    assert "the rest is removed; not looked for" in out and "no model to ask: nowhere holds no *.onnx" in out
    assert read(path / "both.npz").subjects.tolist() == ["08"]
    assert "nothing was removed" in forget("07", path, "--yes")[1]  # where none can be
    assert json.loads(forget("07", path, "--yes", "--json")[1])["removed"] is False


def test_without_onnx_models_cannot_be_asked_and_recordings_go(
    tmp_path: Path, forget: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "07.npz", of("07", "07"))
    (tmp_path / "m.onnx").touch()
    monkeypatch.setitem(sys.modules, "onnx", None)
    status, out, _ = forget("07", tmp_path, "--models", tmp_path, "--yes")
    assert (status, (tmp_path / "07.npz").exists()) == (0, False)
    assert "m.onnx: cannot be asked: onnx is missing: pip install 'gestured[lab]'" in out


def test_models_say_whose_recordings_they_learned_from(path: Path, forget: Run) -> None:
    onnx = pytest.importorskip("onnx")
    models = path / "models"
    models.mkdir()
    learned = {
        "a.onnx": origins([path / "both.npz"]),
        "b.onnx": origins([path / "08.npz"]),
        "c.onnx": None,
        "d.onnx": [],
    }
    for name, origin in learned.items():
        proto = onnx.ModelProto(ir_version=8)
        onnx.helper.set_model_props(proto, {} if origin is None else {"learned_from": json.dumps(origin)})
        (models / name).write_bytes(proto.SerializeToString())
    _, out, _ = forget("07", path, "--models", models, "--yes")
    told = [line.split(": ", 1)[1] for line in out.splitlines() if line.startswith("model ")]
    assert told == [
        "learned from a 07, in both.npz; weights cannot forget: train it again without them",
        "learned from no 07",
        "does not say whose recordings it learned from",
        "learned from no 07",
    ]
    assert "a.onnx: learned from a 7, in both.npz" in forget("7", path, "--models", models, "--yes")[1]


def test_what_is_no_model_is_told(tmp_path: Path, forget: Run) -> None:
    (tmp_path / "broken.onnx").write_bytes(b"no model at all")
    write(tmp_path / "07.npz", join_recordings([of("07", "08"), of("08", "08")]))
    _, out, _ = forget("07", tmp_path / "07.npz", "--models", tmp_path, "--dry-run")
    assert f"model {tmp_path / 'broken.onnx'}: cannot be read: " in out


def test_a_model_keeps_the_days_of_consent(tmp_path: Path) -> None:
    days = np.array(["2026-01-31", "2026-02-28"])
    write(tmp_path / "both.npz", replace(of("07", "07"), consents=days))
    write(tmp_path / "08.npz", replace(of("08", "09"), consents=np.array(["2026-03-01", ""])))
    found = origins([tmp_path / "both.npz", tmp_path / "08.npz"])
    assert [origin["consents"] for origin in found] == [{"07": "2026-02-28"}, {"08": "2026-03-01"}]
