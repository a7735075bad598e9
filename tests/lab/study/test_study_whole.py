"""The study from end to end on very little: every section is there, and a second run is the same."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from experiments.foreign.recordings import recordings
from gestured.lab import cli
from gestured.lab.dataset import TRIALS
from gestured.lab.made_of import LINE
from gestured.lab.study import cells, cohort, run_time
from gestured.lab.study.methods import METHODS
from gestured.lab.study.tables import Plan
from gestured.record.arrays import write

SECTIONS = ("about", "machine", "data", "methods", "cells", "trials", "copies", "choices", "run_time", "online")
LEFT = ("tp_rf", "lstm", "cnn_lstm")  # those that ship


@pytest.mark.slow
def test_a_small_study_has_every_section_and_is_the_same_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in set(METHODS) - set(LEFT):
        monkeypatch.delitem(METHODS, name)
    small_forest = ({"features": "paper", "trees": 10, "depth": 4},)
    monkeypatch.setitem(METHODS, "tp_rf", replace(METHODS["tp_rf"], grid=small_forest))
    few = [t.index for t in TRIALS if t.participant < 3 and t.speed == "normal" and t.inclination == 1]
    monkeypatch.setattr(Plan, "trials", lambda self: np.array(few, np.int64))
    monkeypatch.setattr(Plan, "trials_of", lambda self, people: np.array(few[:10], np.int64))
    monkeypatch.setattr(run_time, "WARM", 1)
    small = Plan.small
    monkeypatch.setattr(Plan, "small", lambda: replace(small(), steps=4, timed=2))
    for module in (cells, cohort):
        monkeypatch.setattr(module, "in_processes", lambda make, todo, *_: map(make, todo))
    write(tmp_path / "foreign.npz", recordings(1))
    where = ["--cache", str(tmp_path / "cache"), "--jobs", "1"]
    where += ["--foreign", str(tmp_path / "foreign.npz")]
    pages = [tmp_path / "docs" / f"{block}.md" for block in ("study", "choice")]
    pages[0].parent.mkdir()
    for page in pages:
        page.write_text(f"<!-- {page.stem}: begin -->\n<!-- {page.stem}: end -->\n")
    for out in ("first", "second"):
        if out == "second":  # the same pictures would be drawn again
            for name in ("confusion", "operating_points"):
                monkeypatch.setattr(f"gestured.lab.study.picture.{name}", lambda study: Figure())
            where += ["--document", *map(str, pages)]
        assert cli.main(["study", "--quick", "--out", str(tmp_path / out), *where]) == 0
    first, second = (json.loads((tmp_path / out / "study.json").read_text()) for out in ("first", "second"))
    assert set(SECTIONS) <= set(first)
    assert {(c["method"], c["protocol"]) for c in first["cells"]} == {
        (m, p) for m in LEFT for p in ("paper", "clean", "participants", "foreign")
    }
    assert all(0 <= c["low"] <= c["right"] <= c["high"] <= 1 for c in first["cells"])
    assert all(set(of["speed"].values()) >= {None} and of["inclination"]["0"] is None for of in first["trials"])
    assert {of["method"]: of["speed"]["normal"] for of in first["trials"]} == {
        c["method"]: c["right"]
        for c in first["cells"]
        if (c["protocol"], c["augmentation"]) == ("participants", "shift")
    }  # the only speed that these few trials have
    assert first["data"]["simulated"]["cut"] + first["data"]["simulated"]["lost"] == len(few)
    assert {**second, "about": 0, "machine": 0} == {**first, "about": 0, "machine": 0}
    assert (tmp_path / "first" / "tables.md").exists() and (tmp_path / "first" / "operating-points.svg").exists()
    told, report = pages[0].read_text().splitlines(), (tmp_path / "second" / "tables.md").read_text().splitlines()
    assert LINE.fullmatch(told[1]) and [line for line in report[1:] if line[:1] != "!"] == told[3:-1]
    assert (pages[0].parent / "operating-points.json").exists() and "| CNN-LSTM | you have" in pages[1].read_text()
    timed = {(row["method"], row["settings"]) for row in first["run_time"]}
    assert {("cnn_lstm", "shipped"), ("lstm", "tuned"), ("tp_rf", "tuned")} <= timed
    assert all(0 <= row["fields"]["simulated"]["wrong"] <= 1 and row["cold_us"] > 0 for row in first["run_time"])
