"""The judge of everyday life: the same rules for our hours, the other generator's and recorded ones."""

import json
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.everyday.__main__ import FIRST, lived, main
from experiments.foreign import session
from gestured.record.arrays import write
from gestured.record.judge import NONE
from gestured.record.recordings import Recordings


def _said(arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    monkeypatch.setattr(sys, "argv", ["everyday", "--json", *arguments])
    main()
    found = json.loads(capsys.readouterr().out)
    return dict(zip(found["head"], found["rows"][-1], strict=True))


def test_of_a_recording_that_does_not_tell_what_was_performed_all_that_is_said_is_false(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    one = session(9100, "nominal", 60.0, 0.0)
    events = one["events"]
    silent = Recordings(
        frames=one["frames"], times=one["times"], offsets=np.array([0, len(one["times"])]),
        labels=np.array(["session"]), subjects=np.array([0]),
    )  # fmt: skip
    marks = {
        "event_recording": np.zeros(len(events), np.int64),
        "event_labels": np.array([event["label"] for event in events]),
        "event_kinds": np.array([event["kind"] for event in events]),
        "event_onsets": np.array([event["onset"] for event in events]),
        "event_offsets": np.array([event["release"] for event in events]),
    }
    write(tmp_path / "silent.npz", silent)
    write(tmp_path / "told.npz", Recordings(**dict(silent.present()), **marks))
    unknown = _said(["--recordings", str(tmp_path / "silent.npz")], monkeypatch, capsys)
    known = _said(["--recordings", str(tmp_path / "told.npz")], monkeypatch, capsys)
    assert float(known["right"]) > 0.8 and known["false an hour"] < 0.2 * unknown["false an hour"]
    hours = float(one["times"][-1] - one["times"][0]) / 3600
    assert unknown["false an hour"] * hours >= 0.8 * len(events) and float(unknown["right"]) == 0.0


@pytest.mark.parametrize("foreign", [None, "nominal"])
def test_the_hours_of_either_generator_carry_their_truth(foreign: str | None) -> None:
    life = next(lived(Namespace(foreign=foreign, recordings=[], hours=1, seed=FIRST)))
    assert life.frames.shape == (len(life.times), 9, 9) and life.contacts >= 0.02 * life.times[-1]
    assert life.meant and all(0 < act.onset < act.offset < life.times[-1] for act in [*life.meant, *life.taps])
    assert all(act.label != NONE for act in life.meant) and all(act.label == NONE for act in life.taps)
