"""docs/collecting.md: its commands run, in its order, on what they speak of."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from gestured.control.cli import parser as gesturectl_parser
from gestured.core.frames import Frame
from gestured.lab.cli import main, parser
from gestured.lab.recordings.protocol import Exercise
from gestured.lab.recordings.quality import Captured
from gestured.lab.recordings.store import join_recordings, recording, touched
from gestured.record.arrays import read, write
from gestured.simulator import GESTURES, Participant, SimulatedSensor, generator, gesture_take
from tests.lab.recordings.test_import import csv_lines, take, written

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "collecting.md"
BLOCKS = re.findall(r"^```(sh|python)\n(.*?)^```$", DOCUMENT.read_text(), re.MULTILINE | re.DOTALL)
NEEDS_A_SENSOR = "# needs a sensor"


def collected(gesture: str) -> Captured:
    made = gesture_take(gesture, Participant(7), SimulatedSensor.nominal(day=7), generator(8, 1), "normal", 1)
    marks = touched(made.frames, made.times)
    assert marks is not None
    frames = tuple(Frame(float(t), values) for t, values in zip(made.times, made.frames, strict=True))
    return Captured(frames, *marks, 1.0)


def test_the_walk_through_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("recordings").mkdir()
    takes = [recording(collected(g), Exercise(g, "normal", 0), "07", "2026-01-31") for g in GESTURES]
    write("recordings/07.npz", join_recordings(takes))
    for name in ("left-1.csv", "left-2.csv"):
        written(Path(name), csv_lines(take()))
    written(Path("session.csv"), csv_lines(take(), 1e3))
    ran = 0
    for line in [line for kind, text in BLOCKS for line in ([text] if kind == "python" else text.splitlines())]:
        if line.startswith("import "):
            exec(line, {})
            printed = capsys.readouterr().out
            assert "one_tap 1\n" in printed and "np." not in printed
            continue
        program, *arguments = shlex.split(line, comments=True)
        if line.endswith(NEEDS_A_SENSOR):  # test_collect runs such ones
            (gesturectl_parser() if program == "gesturectl" else parser()).parse_args(arguments)
            continue
        assert program == "gestured-lab"
        assert main(arguments) == 0, capsys.readouterr().err
        assert capsys.readouterr().out
        ran += 1
    assert ran == 4
    assert not Path("recordings/07.npz").exists()
    more = read("more.npz")
    assert more.labels.tolist() == ["swipe_left"] * 2
    assert more.onsets is not None and np.all(more.onsets > 0)
