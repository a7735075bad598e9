"""`gesturectl tune`: what thresholds cost is counted rightly, and what it proposes costs least."""

import json
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.control.cli import main
from gestured.control.tuning import THRESHOLDS, Counts, Played, counted, for_each, proposed
from gestured.record.arrays import write
from gestured.record.judge import Performed
from gestured.simulator import GESTURES
from tests.lab.adapt.recorded import whole_session

NAMES = ("one_tap", "swipe_left", "swipe_right")


def event(name: str, onset: float, confidence: float) -> dict[str, object]:
    return {"gesture": name, "onset": onset, "offset": onset + 0.3, "confidence": confidence}


def evening() -> Played:
    """Five gestures: two right, one wrong, one never seen, one said twice; a non-gesture; and an event from nothing."""
    played = Played(seconds=1800.0)
    performed = [Performed(name, name, float(t), t + 0.3) for t, name in enumerate(NAMES + NAMES[:2])]
    performed.append(Performed("none", "scribble", 10.0, 10.5))
    said = [
        event("one_tap", 0.0, 0.9), event("swipe_left", 1.0, 0.6), event("swipe_left", 2.0, 0.4),
        event("one_tap", 3.0, 0.8), event("one_tap", 3.2, 0.7), event("swipe_left", 10.0, 0.5),
        event("one_tap", 20.0, 0.3),
    ]  # fmt: skip
    played.add(performed, said)
    return played


def test_each_threshold_is_counted() -> None:
    played = evening()
    assert (len(played.performed), played.others) == (5, 1)
    assert counted(played, 0.05) == Counts(0.05, right=3, wrong=1, missed=1, false=3)
    assert counted(played, 0.45) == Counts(0.45, right=3, wrong=0, missed=2, false=2)
    assert counted(played, 0.85) == Counts(0.85, right=1, wrong=0, missed=4, false=0)
    assert counted(played, 0.05, "swipe_left") == Counts(0.05, right=1, wrong=1, missed=1, false=1)


@given(st.lists(st.tuples(st.sampled_from(NAMES), st.floats(0, 1)), max_size=12), st.floats(0.5, 9))
def test_what_is_proposed_costs_least(said: list[tuple[str, float]], each: float) -> None:
    played = Played(seconds=60.0)
    performed = [Performed(NAMES[k % 3], "", 2.0 * k, 2.0 * k + 0.3) for k in range(8)]
    played.add(performed, [event(name, 2.0 * k, confidence) for k, (name, confidence) in enumerate(said)])
    rows = [counted(played, threshold) for threshold in THRESHOLDS]
    for row in rows:
        assert row.right + row.wrong + row.missed == 8
        assert row.right + row.wrong + row.false == sum(confidence >= row.threshold for _, confidence in said)
    best = proposed(rows, played, each, 0.5)
    assert all(best.cost(each) <= row.cost(each) for row in rows)
    assert not for_each(played, each, 0.5)  # of each there are too few


def test_without_gestures_the_lowest_that_is_quiet_enough_is_proposed() -> None:
    played = Played(seconds=3600.0)
    played.add([], [event("one_tap", 100.0 * k, 0.1 * k) for k in range(1, 8)])
    rows = [counted(played, threshold) for threshold in THRESHOLDS]
    assert proposed(rows, played, 3.0, 0.5).threshold == 0.65
    played.seconds = 60.0
    assert proposed(rows, played, 3.0, 0.5).threshold == 0.75


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    path = tmp_path / "07.npz"
    write(path, whole_session("07"))
    return path


def test_a_labelled_session_gives_a_table_a_picture_and_settings(
    recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["tune", str(recorded)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert sum(line.lstrip().startswith("0.") for line in lines) == len(THRESHOLDS)
    pasted = "[sensors.armrest]\nrotate = 90\n" + "\n".join(lines[lines.index("for the configuration file:") + 1 :])
    thresholds = {name: table["threshold"] for name, table in tomllib.loads(pasted)["gestures"].items()}
    assert set(thresholds) == set(GESTURES) and set(thresholds.values()) <= set(THRESHOLDS)
    assert main(["tune", str(recorded), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    rows = found["thresholds"]
    assert [row["threshold"] for row in rows] == list(THRESHOLDS)
    assert all(row["right"] + row["wrong"] + row["missed"] == found["gestures"] for row in rows)
    assert all(high["missed"] >= low["missed"] for low, high in zip(rows, rows[1:], strict=False))
    assert found["gestures"] >= 10 and rows[0]["right"] >= 0.8 * found["gestures"]


def test_what_cannot_be_tuned_on_is_one_sentence(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "text.npz").write_text("no recording")
    for arguments, reason in (
        ([tmp_path / "text.npz"], "text.npz: cannot be read as a recording"),
        ([tmp_path / "none.mcap"], "none.mcap"),
        ([recorded, "--wrong-costs", "0"], "--wrong-costs 0: expected"),
        ([recorded, "--model", "nobody"], "nobody: no shipped model"),
    ):
        assert main(["tune", *map(str, arguments)]) == 1
        err = capsys.readouterr().err
        assert reason in err and err.count("\n") == 1
