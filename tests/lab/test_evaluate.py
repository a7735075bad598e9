"""Figures are counted as a user would count them."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from gestured.lab import commands, evaluate
from gestured.lab.evaluate import outcome, worst
from gestured.lab.export import write_manifest
from gestured.lab.fit import CLASSES
from gestured.lab.intervals import CONFIDENCE_LEVEL, student
from gestured.lab.samples import Samples
from gestured.lab.train import MIXED
from gestured.model.shipped import LADDER
from tests.lab.conftest import Run
from tests.small_model import build

THREE = np.eye(3, dtype=np.float32)


def answer(*said: tuple[int, float]) -> tuple[np.ndarray, np.ndarray]:
    """Scores (N, 3) and unknown (N,): which gesture, and how likely none, of each answer."""
    return THREE[[gesture for gesture, _ in said]], np.array([unknown for _, unknown in said], np.float32)


def test_each_answer_counts_once() -> None:
    said = answer((0, 0.0), (1, 0.1), (2, 0.9), (0, 0.0), (1, 0.2), (1, 0.9))
    found = outcome(said, np.array([0, 1, 2, 1, 5, -1]), 0.5, 0, np.arange(6))
    assert (found.gestures, found.others) == (4, 2)  # a kind that nobody knows is none as well
    assert found.right == pytest.approx(2 / 4)
    assert found.wrong == pytest.approx(1 / 4)  # 0 was said of a 1
    assert found.lost == pytest.approx(1 / 4)  # the 2 was held to be none
    assert found.right_before == pytest.approx(3 / 4)
    assert found.rejected == pytest.approx(1 / 2)


def test_what_was_performed_and_never_cut_out_is_lost() -> None:
    said = answer((0, 0.0), (1, 0.0))
    found = outcome(said, np.array([0, 1]), 0.5, 4, np.arange(2))
    assert (found.gestures, found.right, found.wrong, found.lost) == (4, 0.5, 0.0, 0.5)
    assert found.right_before == 0.5


def test_one_gesture_cut_in_two_does_not_make_more_right_than_there_were() -> None:
    found = outcome(answer((0, 0.0), (0, 0.0)), np.array([0, 0]), 0.5, 1, np.arange(2))
    assert found.right <= 1


@pytest.mark.parametrize("least", [0.0, 0.3, 0.6, 0.95])
def test_the_shares_of_the_gestures_add_up(least: float) -> None:
    rng = np.random.default_rng(3)
    said = rng.dirichlet(np.ones(3), 200).astype(np.float32), rng.random(200).astype(np.float32)
    labels = rng.integers(0, 5, 200)
    found, stricter = (outcome(said, labels, one, 0, np.arange(200)) for one in (least, least + 0.04))
    assert found.right + found.wrong + found.lost == pytest.approx(1)
    assert stricter.right <= found.right <= found.right_before
    assert stricter.wrong <= found.wrong
    assert stricter.rejected >= found.rejected


@pytest.mark.parametrize("degrees", [1, 2, 3, 4, 9, 10, 33, 200])
def test_students_distribution_is_that_of_scipy(degrees: int) -> None:
    assert student(degrees) == pytest.approx(stats.t.ppf((1 + CONFIDENCE_LEVEL) / 2, degrees), rel=1e-12)


def test_people_are_what_is_drawn_for_an_interval() -> None:
    """As many right answers, from people who are all alike, and from people of whom half cannot do it at all."""
    people = np.repeat(np.arange(8), 10)
    alike = np.where(np.arange(80) % 2, 0, 1)
    apart = np.where(people % 2, 0, 1)
    said = answer(*[(0, 0.0)] * 80)
    one, other = (outcome(said, labels, 0.5, 0, people) for labels in (alike, apart))
    assert one.right == other.right == 0.5 and one.people == 8
    assert one.intervals["right"] == {"low": 0.5, "high": 0.5}
    assert other.intervals["right"]["low"] < 0.3 and other.intervals["right"]["high"] > 0.7


@pytest.mark.parametrize("performed", [0, 170, 300])
def test_intervals_hold_the_shares_that_they_are_of(performed: int) -> None:
    rng = np.random.default_rng(4)
    said = rng.dirichlet(np.ones(3), 200).astype(np.float32), rng.random(200).astype(np.float32)
    labels, people = rng.integers(0, 4, 200), rng.integers(0, 12, 200)
    found = outcome(said, labels, 0.3, performed, people)
    for name, ends in found.intervals.items():
        assert 0 <= ends["low"] < getattr(found, name) < ends["high"] <= 1
    never = found.gestures - int((labels < 3).sum())
    assert found.intervals["lost"]["low"] >= never / found.gestures  # what was never cut out is lost whoever is drawn


def test_the_worst_is_found_among_those_that_are_there_often_enough() -> None:
    """Taps fare worst, but for a kind that is there once; of two people the second; spikes are taken for gestures."""
    rows = (
        [("one_tap", 0)] * 30 + [("swipe_up", 1)] * 30 + [("swipe_down", 0)] + [("spike", 1)] * 20 + [("wave", 0)] * 20
    )
    right = [n % 3 > 0 for n in range(30)] + [n % 10 > 0 for n in range(30)] + [False] + [False] * 5 + [True] * 35
    kinds = np.array([kind for kind, _ in rows])
    labels = np.where(np.isin(kinds, ["spike", "wave"]), "none", kinds)
    people = np.array([person for _, person in rows])
    nothing = np.zeros(len(rows))
    samples = Samples(nothing, nothing, labels, kinds, people, nothing, nothing, nothing, nothing)  # type: ignore[arg-type]
    scores, unknown = np.zeros((len(rows), 10)), np.zeros(len(rows))
    for n, (kind, good) in enumerate(zip(kinds, right, strict=True)):
        gesture = labels[n] != "none"
        scores[n, CLASSES.index(kind) if gesture and good else 3] = 1.0
        unknown[n] = 1.0 if good and not gesture else 0.0
    assert worst((scores, unknown), samples, 0.5) == {
        "gesture": ("one_tap", 0.667, 30), "person": ("no. 0", 0.645, 31), "non-gesture": ("spike", 0.75, 20),
    }  # fmt: skip


def share(right: float) -> dict[str, object]:
    """Figures of one set, as a manifest has them."""
    shares = {"right": right, "wrong": 0.0, "lost": 1 - right, "rejected": 1.0}
    ends = {name: {"low": value, "high": value} for name, value in shares.items()}
    return {"gestures": 10, "others": 10, "right_before": right, **shares, "people": 3, "intervals": ends, "kinds": {}}


def test_without_real_recordings_their_figures_stay_of_the_same_files_and_no_network_is_needed(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in LADDER:
        build(tmp_path / f"{name}.onnx")
    write_manifest(
        tmp_path, {name: {"simulated": {"wide": share(0.1)}, "real": {MIXED: share(0.75)}} for name in LADDER}
    )
    build(tmp_path / "lstm.onnx", version="9")  # another file than the figures are of
    monkeypatch.setattr(commands, "load_data", lambda *_: SimpleNamespace(real=None))
    monkeypatch.setattr(commands, "simulated_figures", lambda *_: dict.fromkeys(LADDER, {"wide": share(0.5)}))
    for module in (commands, evaluate):
        monkeypatch.setattr(module, "learn", lambda *_: pytest.fail("learns what nothing asks for"), raising=False)
    line = ("evaluate", "--models", tmp_path, "--cache", tmp_path / "cache")
    stood = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    status, _, err = run(*line, "--quick")
    assert status == 0 and "cards and manifest stay as they are" in err
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == stood
    status, _, err = run(*line)
    assert status == 0 and "left out, since no --real FOLDER was named; their figures of the same models stay" in err
    manifest = json.loads((tmp_path / "manifest.json").read_text())["models"]
    for name in LADDER:
        card, figures = (tmp_path / f"{name}.md").read_text(), manifest[f"{name}.onnx"]["figures"]
        assert figures["simulated"]["wide"]["right"] == 0.5 and "0.500 (0.500" in card
        assert ("real" in figures) == (f"| real, {MIXED}" in card) == (name != "lstm")
