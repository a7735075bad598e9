"""docs/collecting.md: its commands run, in its order, on what they speak of."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from gestured.control.cli import parser as gesturectl_parser
from gestured.lab.cli import main, parser
from gestured.lab.recordings.protocol import Exercise
from gestured.lab.recordings.store import join_recordings, recording
from gestured.record.arrays import read, write
from gestured.simulator import GESTURES
from tests.lab.recordings.test_import import csv_lines, take, written
from tests.lab.recordings.test_quality import performed

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "collecting.md"
BLOCKS = re.findall(r"^```(sh|python)\n(.*?)^```$", DOCUMENT.read_text(), re.MULTILINE | re.DOTALL)
NEEDS_A_SENSOR = "# needs a sensor"


def test_the_walk_through_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("recordings").mkdir()
    takes = [recording(performed(g, 7), Exercise(g, "normal", 0), "07", "2026-01-31") for g in GESTURES]
    write("recordings/07.npz", join_recordings(takes))
    for n, name in enumerate(("left-1.csv", "left-2.csv")):
        written(Path(name), csv_lines(take())[n:])
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
