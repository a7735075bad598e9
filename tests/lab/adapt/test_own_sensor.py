"""docs/own-sensor.md: what it does with recordings runs, in its order."""

import shlex
from pathlib import Path

import numpy as np
import pytest

from gestured.control.cli import main as gesturectl
from gestured.lab.adapt import command
from gestured.lab.cli import main as lab
from gestured.lab.own import learn as own
from gestured.model.opening import open_model
from gestured.record.arrays import write
from gestured.simulator import GESTURES
from tests.documents.blocks import blocks
from tests.lab.adapt.recorded import cut_gestures, unknown_sensor
from tests.lab.test_own import drawn


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_document_leads_to_a_model(
    tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "simulate", lambda *_, **__: request.getfixturevalue("small_world"))
    monkeypatch.setattr(own, "played", lambda *_, **__: drawn())
    monkeypatch.chdir(tmp_path)
    Path("recordings").mkdir()
    for k, name in enumerate(("07", "08")):
        made = cut_gestures((name,), GESTURES, repeats=2, sensor=unknown_sensor(k))
        assert made.frames.shape[1:] == (12, 10) and np.ptp(made.frames) > 0
        write(f"recordings/{name}.npz", made)
    ran = []
    words = "tests/lab/adapt/test_own_sensor.py::test_the_document_leads_to_a_model"
    for line in "".join(block.text for block in blocks("run", words)).splitlines():
        program, *arguments = shlex.split(line)
        if arguments[0] == "adapt":
            arguments += ["--steps", "2", "--force"]  # whether it is better is another test's
        status = (gesturectl if program == "gesturectl" else lab)(arguments)
        said = capsys.readouterr()
        assert status == 0 or (arguments[0] == "adapt" and "written: " in said.out), said.err
        ran.append(arguments[0])
    assert ran == ["tune", "adapt", "check"]
    assert open_model(Path("my.onnx")).space is not None  # it can learn gestures of its user's own
