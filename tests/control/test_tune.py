"""`gesturectl tune`: what thresholds cost is counted rightly, and what it proposes costs least."""

import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path
from shutil import copy
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.control import labelled
from gestured.control.tune import _words, play
from gestured.control.tuning import THRESHOLDS, Counts, Played, allowed, counted, tune
from gestured.core.errors import GesturedError
from gestured.core.points import STRICTNESS
from gestured.core.sensor import ABSENT_S
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.record.arrays import read, write
from gestured.record.judge import Performed
from gestured.record.recordings import Recordings
from gestured.simulator import GESTURES
from tests.core import test_gates, test_hub
from tests.daemon import tiny_model
from tests.daemon.harness import Hand
from tests.lab.adapt.recorded import whole_session
from tests.small_model import operating_points
from tests.small_recording import untouched

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
    assert counted(played, 0.05) == Counts(0.05, right=3, wrong=1, missed=1, false=3, unmeant=2)
    assert counted(played, 0.45) == Counts(0.45, right=3, wrong=0, missed=2, false=2, unmeant=1)
    assert counted(played, 0.85) == Counts(0.85, right=1, wrong=0, missed=4, false=0, unmeant=0)
    assert counted(played, 0.05, "swipe_left") == Counts(0.05, right=1, wrong=1, missed=1, false=1, unmeant=0)
    each = {"one_tap": 0.75, "swipe_left": 0.55, "swipe_right": 0.05}
    assert counted(played, each) == Counts(None, right=3, wrong=0, missed=2, false=0, unmeant=0)


# Upper 95 % limits of a Poisson mean by count, as any table of them has it.
@pytest.mark.parametrize(
    ("count", "limit"), [(0, 2.996), (1, 4.744), (2, 6.296), (3, 7.754), (5, 10.513), (10, 16.962)]
)
@pytest.mark.parametrize("per_hour", [0.01, 0.5, 20.0])
def test_a_budget_is_shown_where_its_upper_limit_is(count: int, limit: float, per_hour: float) -> None:
    assert allowed(per_hour, 1.001 * limit / per_hour) == count
    assert allowed(per_hour, 0.999 * limit / per_hour) == (count - 1 if count else None)
    assert allowed(per_hour, 0.0) is allowed(0.0, 1.0) is None


def model_of(path: Path, **metadata: str) -> Model:
    return open_model(tiny_model.make(path, **metadata))


POINTS = operating_points(tiny_model.GESTURES)


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[bool, Model]:
    """Without operating points, and with them."""
    folder = tmp_path_factory.mktemp("models")
    return {False: model_of(folder / "plain.onnx"), True: model_of(folder / "points.onnx", operating_points=POINTS)}


@given(
    st.lists(st.tuples(st.sampled_from(NAMES), st.floats(0, 1)), max_size=30), st.booleans(), st.booleans(),
    st.sampled_from([None, 0.25, 0.5, 1.0]),
)  # fmt: skip
def test_what_is_proposed_keeps_the_budget_and_nothing_that_costs_less_does(
    models: dict[bool, Model], said: list[tuple[str, float]], with_points: bool, performs: bool, budget: float | None
) -> None:
    played = Played(seconds=13 * 3600.0)
    acts = [Performed(NAMES[k % 2], "", 9.0 * k, 9.0 * k + 0.3) for k in range(44 if performs else 0)]
    meant = [event(act.label, act.onset, k % 20 / 20) for k, act in enumerate(acts)]
    played.add(acts, meant + [event(name, 900.0 + 9 * k, confidence) for k, (name, confidence) in enumerate(said)])
    most = 999 if budget is None else {0.25: 0, 0.5: 2, 1.0: 6}[budget]
    model = models[with_points]
    least_possible = min(
        counted(played, one).unmeant
        for one in (0.99, *(point.thresholds for point in (model.points.values() if model.points else ())))
    )
    if budget is not None and least_possible > most:
        with pytest.raises(
            GesturedError, match=f"--budget {budget}: at 0.99 there are still .* expected at most {most}"
        ):
            tune(model, played, budget)
        return
    tuned = tune(model, played, budget)
    if not (with_points or performs or budget):
        assert tuned.best is None
        return
    assert tuned.best is not None and tuned.best.unmeant <= most
    if tuned.best.missed is not None:
        costs = [row.cost for row in (*tuned.rows, *tuned.points.values()) if row.unmeant <= most]
        assert tuned.best.cost <= min(costs, default=math.inf)
    settings = {name: tuned.each.get(name, tuned.best).threshold for name in model.gestures}
    if tuned.strictness is None:  # what is to be pasted costs what is said of it
        found = counted(played, {name: least or 0.0 for name, least in settings.items()})
        assert (found.unmeant, found.right, found.wrong) == (tuned.best.unmeant, tuned.best.right, tuned.best.wrong)


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    path = tmp_path / "07.npz"
    write(path, whole_session("07"))
    return path


def test_a_labelled_session_gives_a_table_a_picture_and_settings(run, recorded: Path) -> None:
    lines = run("tune", recorded)[1].splitlines()
    assert max(map(len, lines)) <= 80
    assert sum(line.lstrip().startswith("0.") for line in lines) == len(THRESHOLDS)
    (told,) = (n for n, line in enumerate(lines) if line.startswith("for the configuration file"))
    proposed, file = "\n".join(lines[told + 1 :]), "[sensors.armrest]\nrotate = 90\n"
    above = "above its tables" in lines[told]
    pasted = tomllib.loads(f"{proposed}\n{file}" if above else f"{file}{proposed}")
    if above:
        assert pasted["strictness"] in STRICTNESS
    else:
        thresholds = {name: table["threshold"] for name, table in pasted["gestures"].items()}
        assert set(thresholds) == set(GESTURES) and set(thresholds.values()) <= set(THRESHOLDS)
    found = json.loads(run("tune", recorded, "--json")[1])
    rows = found["thresholds"]
    assert [row["threshold"] for row in rows] == list(THRESHOLDS)
    assert all(row["right"] + row["wrong"] + row["missed"] == found["gestures"] for row in rows)
    assert all(high["missed"] >= low["missed"] for low, high in zip(rows, rows[1:], strict=False))
    assert found["gestures"] >= 10 and rows[0]["right"] >= 0.8 * found["gestures"]


def test_hours_in_which_a_sensor_did_not_listen_count_like_all_others(
    models: dict[bool, Model], tmp_path: Path
) -> None:
    """Else a day behind a closed gate would show that any threshold keeps any budget."""
    shut = {"type": "gate", "sensor": "arm", "armed": None, "closed": ["door"], "until": None, "since": 1e9 - 1.0}
    armed = {"by": "circle_clockwise"}
    settings: tuple[dict[str, Any], ...] = {}, {"arming": armed}, {"sensors": {"arm": {"arming": armed}}}
    said = []
    for n, told in enumerate(settings):
        path = test_hub.write(tmp_path / f"{n}.mcap", test_gates.DRIVE, [shut] if n else [], **told)
        play(path, models[False], played := Played())
        said.append(played.said)
    assert len(said[0]) == 6 and said[1:] == said[:1] * 2


def test_a_night_in_which_no_packet_came_shows_nothing(models: dict[bool, Model], tmp_path: Path) -> None:
    later = [(t + 36_000.0, packet, source) for t, packet, source in test_gates.DRIVE]
    path = test_hub.write(tmp_path / "night.mcap", [*test_gates.DRIVE, *later])
    play(path, models[False], played := Played())
    drive = test_gates.DRIVE[-1][0] - test_gates.DRIVE[0][0]
    assert played.seconds == pytest.approx(2 * (2 * drive + ABSENT_S), rel=0.001)  # of two sensors
    assert len(played.said) == 12


def test_an_hour_of_a_tape_is_an_hour_of_each_of_its_sensors(models: dict[bool, Model], tmp_path: Path) -> None:
    """As in the model's own figures, and in those of `gestured-lab everyday`."""
    alone = [one for one in test_gates.DRIVE if b"/seat/" not in one[1]]
    one, two = Played(), Played()
    for name, packets, played in (("one", alone, one), ("two", test_gates.DRIVE, two)):
        play(test_hub.write(tmp_path / f"{name}.mcap", packets), models[False], played)
    assert one.said == two.said and two.seconds == pytest.approx(2 * one.seconds, rel=0.02)


def test_a_night_in_a_recording_without_frames_shows_nothing_either(models: dict[bool, Model], tmp_path: Path) -> None:
    write(tmp_path / "night.npz", untouched(np.concatenate([np.arange(600) / 15, 36_000 + np.arange(600) / 15])))
    play(tmp_path / "night.npz", models[False], played := Played())
    assert played.seconds == pytest.approx(2 * 599 / 15 + ABSENT_S)


def taps(path: Path, *, onset: int | None, label: str = "one_tap") -> Path:
    """Three recordings of two quiet seconds and a tap, of which each ends while a second tap could still come."""
    hand, each = Hand(), 37
    frames = np.array(3 * (hand.idle(2.0) + hand.tap() + hand.idle(1 / 3)))
    found = Recordings(
        frames=frames,
        times=np.tile(np.arange(each) / 15, 3),
        offsets=np.arange(4) * each,
        labels=np.array([label] * 3),
        subjects=np.zeros(3, int),
        onsets=None if onset is None else np.full(3, onset),
        releases=None if onset is None else np.full(3, 31),
    )
    write(path, found)
    return path


def test_between_two_recordings_no_time_passes_and_what_waits_is_answered(
    models: dict[bool, Model], tmp_path: Path
) -> None:
    play(taps(tmp_path / "taps.npz", onset=30), models[False], played := Played())
    assert played.seconds == pytest.approx(3 * 36 / 15)
    assert counted(played, 0.0) == Counts(0.0, right=3, wrong=0, missed=0, false=0, unmeant=0)


@pytest.mark.parametrize("raised", [1, -1])
def test_a_gesture_of_which_nobody_marked_the_onset_begins_where_it_stands_out(
    models: dict[bool, Model], tmp_path: Path, raised: int
) -> None:
    path = taps(tmp_path / "taps.npz", onset=None)
    play(path, models[False], played := Played())
    assert counted(played, 0.0) == Counts(0.0, right=3, wrong=0, missed=0, false=0, unmeant=0)
    found = read(path)
    turned = 1000 + raised * found.frames.astype(int)
    assert [labelled.stands_out(turned[start : start + 37]) for start in found.offsets[:-1]] == [30] * 3


def test_what_is_said_of_a_performance_that_is_left_out_counts_neither_way(
    models: dict[bool, Model], tmp_path: Path
) -> None:
    """It began before the sensor was known, nobody knows what it was, or it is no gesture of the model."""
    for n, (onset, label) in enumerate([(0, "one_tap"), (30, "other"), (30, "knock")]):
        play(taps(tmp_path / f"{n}.npz", onset=onset, label=label), models[False], played := Played())
        assert (played.skipped, played.performed, played.said) == (3, [], [])
    play(taps(tmp_path / "others.npz", onset=None, label="none"), models[False], played)
    assert counted(played, 0.0).false == 3


@pytest.mark.parametrize(("hours", "confidence", "told"), [(0.1, 0.1, True), (0.1, 0.99, False), (9.0, 0.1, False)])
def test_minutes_of_gestures_are_said_to_show_nothing_of_what_is_false(
    models: dict[bool, Model], hours: float, confidence: float, told: bool
) -> None:
    """In them nothing false is said at any threshold, and so the lowest one seems to cost nothing."""
    for model in models.values():
        played = Played(seconds=3600 * hours)
        acts = [Performed("one_tap", "", 9.0 * k, 9.0 * k + 0.3) for k in range(30)]
        played.add(acts, [event("one_tap", act.onset, confidence) for act in acts])
        words = [*_words(tune(model, played, None))]
        assert any("these minutes cannot show it" in line for line in words) == told
        assert max(map(len, words)) <= 80


def test_few_hours_do_not_make_it_say_more(models: dict[bool, Model]) -> None:
    """Nobody performed anything, and nothing false was said: so it would be at any threshold in a minute."""
    for hours, strictness in ((0.1, "normal"), (9.0, None)):
        tuned = tune(models[True], Played(seconds=3600 * hours), None)
        assert tuned.best is not None and tuned.strictness == strictness
    assert tuned.best.threshold == 0.05


def test_what_cannot_be_tuned_on_is_one_sentence(run, recorded: Path, tmp_path: Path) -> None:
    (tmp_path / "text.npz").write_text("no recording")
    found = read(taps(tmp_path / "taps.npz", onset=30))
    write(tmp_path / "ms.npz", replace(found, times=1000 * found.times))  # hours in which nothing false was said
    for arguments, reason in (
        ([tmp_path / "text.npz"], "text.npz: cannot be read as a recording"),
        ([tmp_path / "none.mcap"], "none.mcap"),
        ([tmp_path / "ms.npz"], "ms.npz: times of recording 0: expected 2 to 2500 frames a second, found 0.015"),
        ([recorded, recorded], "07.npz: expected each file once"),
        ([recorded, copy(recorded, tmp_path / "08.npz")], "08.npz: expected each file once, found it as"),
        ([recorded, "--budget", "0.5"], "hours cannot show it, even if nothing false was said in them, expected at"),
        ([recorded, "--budget", "0.7"], "expected at least 4.3 hours"),
        ([recorded, "--model", "nobody"], "nobody: no shipped model"),
    ):
        status, _, err = run("tune", *arguments)
        assert status == 1 and reason in err and err.count("\n") == 1


def test_a_tape_that_is_too_short_is_told_how_long_it_is(run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def play(path: Path, model: Model, played: Played) -> None:
        played.seconds += 3.1

    monkeypatch.setattr("gestured.control.tune.play", play)
    status, _, err = run("tune", "short.mcap")
    assert status == 1 and "short.mcap: found 3 s in which nobody made a gesture, expected at least 60 s of that" in err


def test_gestures_that_begin_before_the_sensor_is_known_are_not_said_to_be_missing(run, tmp_path: Path) -> None:
    status, _, err = run("tune", taps(tmp_path / "taps.npz", onset=5))
    assert status == 1
    assert "or recorded gestures; 3 are left out, of unknown names or without a quiet second before them\n" in err


def test_a_day_on_which_nobody_performed_anything_is_not_given_thresholds_that_miss_nothing(
    run, models: dict[bool, Model], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    false = 60

    def day(path: Path, model: Model, played: Played) -> None:
        played.seconds += 7 * 3600.0
        played.add([], [event("one_tap", 60.0 * k, 0.90 + k / 1000) for k in range(false)])

    monkeypatch.setattr("gestured.control.tune.play", day)
    paths = {has: tmp_path / f"{has}.onnx" for has in models}
    for has, path in paths.items():
        tiny_model.make(path, **({"operating_points": POINTS} if has else {}))

    def said(has: bool, *more: str) -> tuple[str, dict[str, Any]]:
        asked = ("tune", "day.mcap", "--model", paths[has], *more)
        return run(*asked)[1], json.loads(run(*asked, "--json")[1])

    words, found = said(False)
    assert "proposed nothing: nobody performed a gesture" in words and "0.0 %    0.0 %" not in words
    assert (found["proposed"], found["missed_by"], found["thresholds"][0]["missed"]) == (None, None, None)
    words, found = said(False, "--budget", "0.5")
    assert "proposed 0.96: 0 false" in words and "[gestures.one_tap]\nthreshold = 0.96" in words
    words, found = said(True)
    # By its curve the model misses a tenth of what the threshold is.
    assert "what is missed is taken from the model's own curve" in words and found["missed_by"] == "model"
    rows = {row["threshold"]: row["missed"] / (20 * 7) for row in found["thresholds"]}
    assert rows == pytest.approx({t: t / 10 for t in rows}) and found["proposed"]["missed"] > 0
    assert found["operating_points"]["strict"]["missed"] / 140 == pytest.approx(0.09)
    assert found["proposed"]["threshold"] == 0.96
    assert "[gestures.one_tap]\nthreshold = 0.96" in words
    # Where one threshold for all misses much more than the model's own ones, a strictness is proposed.
    tiny_model.make(paths[True], operating_points=operating_points(tiny_model.GESTURES, curve=[[0.05, 0.99, 9]]))
    false = 10
    words, found = said(True)
    assert found["strictness"] in STRICTNESS
    assert words.endswith(f'above its tables:\nstrictness = "{found["strictness"]}"\n')
