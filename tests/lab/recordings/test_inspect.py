"""`gestured-lab inspect`: the figures are the file's own, and the drawing shows where and when it was touched."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gestured.lab.cli import main
from gestured.record.arrays import write
from gestured.record.recordings import Recordings
from tests.small_recording import example, save, session


def stroke() -> Recordings:
    """A finger that goes right along the middle row, at 10 Hz with one lost frame; then the same for somebody else."""
    frames = np.full((20, 9, 9), 100.0)
    for k in range(9):
        frames[6 + k, 4, k] += 500
    times = np.delete(np.arange(21) / 10, 3)
    return Recordings(
        np.concatenate([frames, frames]), np.concatenate([times, times]), np.array([0, 20, 40]),
        np.array(["swipe_right", "none"]), np.array(["07", "08"]), inclinations=np.array([0, 2]),
        onsets=np.array([6, 6]), releases=np.array([14, 14]),
    )  # fmt: skip


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    status = main(["inspect", *map(str, arguments)])
    out, err = capsys.readouterr()
    return status, out, err


def test_the_figures_are_the_files_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "r.npz", stroke())
    status, out, _ = run(capsys, tmp_path / "r.npz", "--json")
    found = json.loads(out)
    assert status == 0
    assert found["recordings"] == 2
    assert found["labels"] == {"none": 1, "swipe_right": 1}
    assert found["participants"] == {"07": 1, "08": 1}
    assert found["inclinations"] == {"flat": 1, "upright": 1}
    assert (found["grid"], found["frames"], found["seconds"]) == ("9x9", 40, 4.0)
    assert (found["rate_hz"], found["jitter_ms"], found["lost_frames"]) == (10.0, 0.0, 2)
    assert found["peak"]["median"] == 500
    assert found["touched_s"]["median"] == pytest.approx(0.9)
    assert found["left_out"] == []


def test_one_gesture_is_drawn_over_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "r.npz", stroke())
    status, out, _ = run(capsys, tmp_path / "r.npz", "--index", "0")
    assert status == 0
    lines = out.splitlines()
    assert f"  {'▁' * 6}{'█' * 9}{'▁' * 5}  2.00 s" in lines
    assert f"  {' ' * 6}{'━' * 9}{' ' * 5}  touched" in lines
    (row,) = [line for line in lines if line.count("█") == 6]  # a snapshot each, one place after the other
    assert [row.split("█")[0].count(" ") - 2] == [0]
    assert len(row) == 2 + 6 * 9 + 5 * 3


def test_where_it_was_touched_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "r.npz", stroke())
    lines = run(capsys, tmp_path / "r.npz")[1].splitlines()
    start = lines.index("  where it was touched")
    assert [line.strip() for line in lines[start + 1 : start + 6]] == ["", "", "█████████", "", ""]


def test_events_and_what_was_left_out_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = save(tmp_path / "r.npz", session(), labels=np.array(["session", "Not A Label"]))
    status, out, _ = run(capsys, path, "--json")
    found = json.loads(out)
    assert (status, found["recordings"], found["events"]) == (0, 1, {"none": 1})
    (left,) = found["left_out"]
    assert left.startswith(f"{path}: recording 1 is left out: labels: expected 1 to 64")
    assert "  left out      1" in run(capsys, path)[1]


@pytest.mark.parametrize(
    ("change", "index", "expected"),
    [
        ({}, "2", "--index: expected 0 to 1, found 2"),
        ({}, "-1", "--index: expected 0 to 1, found -1"),
        ({"labels": np.array(["A", "B"])}, "0", "none of its recordings can be used"),
        ({"frames": None}, "0", "frames: is missing"),
    ],
)
def test_what_cannot_be_shown_is_one_sentence(
    change: dict[str, object], index: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = save(tmp_path / "r.npz", example(), **change)
    status, out, err = run(capsys, path, "--index", index)
    assert (status, out, len(err.splitlines())) == (1, "", 1)
    assert expected in err


def test_any_good_recording_can_be_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One frame, no pressure, negative counts, a long recording, an odd grid."""
    one = Recordings(np.zeros((1, 2, 64)), np.zeros(1), np.array([0, 1]), np.array(["none"]), np.array([1]))
    long = Recordings(
        -np.ones((5000, 3, 2)), np.arange(5000) / 1000, np.array([0, 5000]), np.array(["none"]), np.array([1])
    )
    for recordings in (one, long, replace(example(), kinds=None)):
        write(tmp_path / "r.npz", recordings)
        assert run(capsys, tmp_path / "r.npz")[0] == 0
        assert run(capsys, tmp_path / "r.npz", "--index", "0")[0] == 0
