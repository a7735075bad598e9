"""The study from end to end on very little: every section is there, and a second run is the same."""

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from experiments.foreign.recordings import recordings
from gestured.lab import cli
from gestured.lab.dataset import TRIALS
from gestured.lab.made_of import LINE
from gestured.lab.study.methods import METHODS
from gestured.lab.study.plan import Plan
from gestured.record.arrays import write

SECTIONS = ("about", "machine", "data", "methods", "cells", "copies", "tuning", "choices", "run_time", "online")
LEFT = ("tp_knn", "tp_rf", "lstm", "cnn_lstm")  # the fastest, and those that ship


@pytest.mark.slow
def test_a_small_study_has_every_section_and_is_the_same_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in set(METHODS) - set(LEFT):
        monkeypatch.delitem(METHODS, name)
    few = [t.index for t in TRIALS if t.participant < 3 and t.speed == "normal" and t.inclination == 1]
    monkeypatch.setattr(Plan, "trials", lambda self: np.array(few, np.int64))
    (tmp_path / "none").mkdir()
    write(tmp_path / "foreign.npz", recordings(1))
    where = ["--cache", str(tmp_path / "cache"), "--real", str(tmp_path / "none"), "--jobs", "1"]
    where += ["--foreign", str(tmp_path / "foreign.npz")]
    page = tmp_path / "docs" / "study.md"
    page.parent.mkdir()
    page.write_text("<!-- study: begin -->\n<!-- study: end -->\n")
    for out in ("first", "second"):
        if out == "second":  # the same pictures would be drawn again
            monkeypatch.setattr("gestured.lab.study.report.figures.confusion", lambda study: Figure())
            monkeypatch.setattr("gestured.lab.study.report.picture.operating_points", lambda study: Figure())
            where += ["--document", str(page)]
        assert cli.main(["study", "--quick", "--out", str(tmp_path / out), *where]) == 0
    first, second = (json.loads((tmp_path / out / "study.json").read_text()) for out in ("first", "second"))
    assert set(SECTIONS) <= set(first)
    assert {(c["method"], c["protocol"]) for c in first["cells"]} == {
        (m, p) for m in LEFT for p in ("paper", "clean", "participants", "foreign")
    }
    assert all(0 <= c["low"] <= c["right"] <= c["high"] <= 1 for c in first["cells"])
    assert first["data"]["simulated"]["cut"] + first["data"]["simulated"]["lost"] == len(few)
    assert {**second, "about": 0, "machine": 0} == {**first, "about": 0, "machine": 0}
    assert (tmp_path / "first" / "cells.csv").read_text().count("\n") == len(first["cells"]) + 1
    assert (tmp_path / "first" / "tables.md").exists() and (tmp_path / "first" / "operating-points.svg").exists()
    told, report = page.read_text().splitlines(), (tmp_path / "second" / "tables.md").read_text().splitlines()
    assert LINE.fullmatch(told[1]) and [line for line in report[1:] if line[:1] != "!"] == told[3:-1]
    assert (page.parent / "operating-points.json").exists()
    timed = {(row["method"], row["settings"]) for row in first["run_time"]}
    assert {("cnn_lstm", "shipped"), ("lstm", "tuned"), ("tp_knn", "tuned")} <= timed
    assert all(0 <= row["wrong"] <= row["error"] <= 1 and row["cold_us"] > 0 for row in first["run_time"])
