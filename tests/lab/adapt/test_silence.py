"""`gestured-lab adapt` with tapes: a model learns from hours in which nobody made a gesture."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from gestured.client.sensor import Form
from gestured.core.frames import Frame
from gestured.lab.adapt import silence
from gestured.lab.recordings.origin import said
from gestured.model.opening import open_model
from gestured.record.arrays import write
from gestured.record.tape_writer import Writer
from gestured.simulator import GESTURES, Participant, SimulatedSensor, generator, gesture_take
from tests.lab.adapt.recorded import cut_gestures
from tests.lab.conftest import Run

SILENCE = "silence"
TAUGHT = [name for name in GESTURES if name != "swipe_up"]


def tape(
    path: Path, kinds: Sequence[str], grid: Sequence[int] = (9, 9), seed: int = 0, names: Sequence[str] = ("arm",)
) -> Path:
    """A tape of sensors on which these kinds happened, one after the other; they are silent for an hour of SILENCE."""
    settings = {"model": "cnn_lstm", "fallback": [], "grid": list(grid), "sensors": {}}
    told = {"settings": settings, "gestures": ["one_tap"], "model": {"rows": 9, "columns": 9}}
    sensor, forms, now, n = SimulatedSensor.nominal(day=70), [Form(name) for name in names], 1.0, 0
    with Writer(path, told, 1 << 28) as writer:
        for k, kind in enumerate(kinds):
            if kind == SILENCE:
                now += 3600.0
                continue
            take = gesture_take(kind, Participant(600 + seed), sensor, generator(32, seed, k))
            for frame, t in zip(take.frames, take.times - take.times[0] + 1 / 15, strict=True):
                for form in forms:
                    packet = form.packet(Frame(0.0, frame[: grid[0], : grid[1]]), n, 0.0)
                    writer.packet(10**18 + round((now + t) * 1e9), "127.0.0.1:5", packet)
                n += 1
            now += float(take.times[-1] - take.times[0]) + 1 / 15
    return path


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Minutes are enough, since all that happens in them is of one kind."""
    monkeypatch.setattr(silence, "LEAST_HOURS", 0.01)


@pytest.mark.usefixtures("short")
@pytest.mark.timeout(300)
def test_what_nobody_meant_on_this_sensor_is_no_gesture_any_more(run: Run, tmp_path: Path) -> None:
    """A strap slides up the sensor all day, as a finger would; everything else is still recognised."""
    write(tmp_path / "a.npz", cut_gestures(("07", "08"), TAUGHT, repeats=2))
    tapes = [tape(tmp_path / f"{n}.mcap", ["swipe_up"] * 16, seed=n) for n in range(3)]
    status, out, err = run("a.npz", *tapes, "--out", "my.onnx", "--base", "cnn_lstm", "--json")
    assert status == 0, err
    found = json.loads(out)
    before, after = found["before_as_many_right"], found["after"]
    assert before["false_per_hour"]["is"] > 200  # nearly each time
    assert after["false_per_hour"]["is"] < before["false_per_hour"]["is"] / 4
    assert after["right"]["is"] >= found["before"]["right"]["is"] > 0.8
    assert found["held_out"] == {"recordings": "people", "tapes": "tapes"}
    model, old = open_model(tmp_path / "my.onnx"), open_model("cnn_lstm")
    assert model.points is not None and model.points["normal"].hours == pytest.approx(found["hours"], abs=0.1)
    window = np.random.default_rng(1).random((1, 12, 9, 9), np.float32)
    np.testing.assert_allclose(model.run(window)[0], old.run(window)[0], atol=1e-4)  # names stay what they are
    origins = said(tmp_path / "my.onnx")
    assert origins is not None and [one.file for one in origins[-4:]] == ["a.npz", "0.mcap", "1.mcap", "2.mcap"]


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("day.mcap", "--base", "cnn_lstm"), "day.mcap: expected recordings of gestures (.npz) beside tapes"),
        (("a.npz", "wide.mcap"), "wide.mcap: expected the grid 9x9 of the recordings, found 9x8"),
        (("a.npz", "few.mcap"), "few.mcap: expected at least 0.01 h of tapes with 20 contacts"),
        (("a.npz", "a.mcap"), "a.mcap"),
    ],
)
def test_what_no_silence_can_be_learned_from_is_one_sentence(
    arguments: tuple[str, ...], reason: str, run: Run, tmp_path: Path
) -> None:
    write(tmp_path / "a.npz", cut_gestures(("07",), GESTURES, repeats=3))
    tape(tmp_path / "day.mcap", ["one_tap"] * 24)
    tape(tmp_path / "few.mcap", ["one_tap"] * 3)
    tape(tmp_path / "wide.mcap", ["one_tap"], (9, 8))
    status, out, err = run(*arguments, "--out", "my.onnx")
    assert (status, out, err.count("\n")) == (1, "", 1) and reason in err
    assert not (tmp_path / "my.onnx").exists()


def test_a_model_that_says_more_than_the_one_in_use_is_no_better() -> None:
    def cost(false: float) -> silence.Cost:
        return silence.Cost((false, 0.0, 1.0), (0.8, 0.0, 1.0), (0.0, 0.0, 1.0))

    def reasons(before: float, moved: float, after: float) -> list[str]:
        held = dict.fromkeys(("judged", "points", "provisional", "lived", "known", "confidence"), None)
        costs = {"before": cost(before), "moved": cost(moved), "after": cost(after)}
        return silence.Quieter(least=0.5, unit="people", **held, **costs).reasons()  # type: ignore[arg-type]

    assert reasons(18.0, 22.0, 20.0) == ["false gestures do not go down (18.00 -> 20.00 an hour)"]
    assert reasons(22.0, 18.0, 20.0) and not reasons(18.0, 22.0, 7.0)


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize(("between", "names"), [([], ["arm"]), ([SILENCE], ["arm"]), ([], ["left", "right"])])
def test_a_single_tape_is_held_out_in_parts(
    between: list[str], names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(silence, "ABSENT_S", 1.0)  # what a silence counts for, on a tape of a minute
    path = tape(tmp_path / "day.mcap", ["one_tap"] * 12 + between + ["one_tap"] * 12, names=names)
    lived = silence.own_hours([path], (9, 9))
    assert lived.unit == "parts of one tape" and len(lived.hours) == 5
    assert np.ptp(lived.hours) == 0 and np.bincount(lived.samples.people, minlength=5).min() >= 4 * len(names)


@pytest.mark.usefixtures("short")
def test_the_sensors_of_a_tape_are_not_held_out_from_each_other(tmp_path: Path) -> None:
    """One person may be on both at once."""
    paths = [
        tape(tmp_path / f"{len(names)}.mcap", ["one_tap"] * 16, names=names) for names in (["left", "right"], ["arm"])
    ]
    lived = silence.own_hours(paths, (9, 9))
    assert lived.unit == "tapes" and lived.hours[0] == pytest.approx(2 * lived.hours[1])
    both, one = np.bincount(lived.samples.people)
    assert both == 2 * one
