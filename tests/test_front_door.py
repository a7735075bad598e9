"""What `import gestured` offers: cheap until it is used, and clear about mistakes; and how its programs begin."""

import copy
import json
import pickle
import subprocess
import sys
import threading
from argparse import Namespace
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest

import gestured
from gestured.client.program import INTERRUPTED, Parser, run
from gestured.core.events import Onset
from gestured.core.frames import Frame, Touch
from gestured.core.front_end import Cut, FrontEnd
from gestured.core.own import Example
from gestured.model import own_file
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.simulator import Participant, SimulatedSensor, generator, session
from tests.daemon import tiny_model
from tests.daemon.harness import Hand
from tests.scenario import frames
from tests.small_model import build, operating_points

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def recognizer(shelf: Path) -> Any:
    return gestured.open("cnn_lstm", sensor="armrest", grid=(9, 9))


def test_importing_the_package_imports_nothing_else():
    code = "import sys; before = set(sys.modules); import gestured; print(*sorted(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["gestured"]


@pytest.mark.parametrize(
    ("program", "words", "status"),
    [("control", "tune", 130), ("control", "simulate", 0), ("bridge", "serial", 0), ("lab", "collect", 130)],
)
def test_ctrl_c_while_a_program_imports_its_modules_leaves_no_traceback(program: str, words: str, status: int):
    code = """
import os, signal, sys
class Interrupted:
    def find_spec(self, name, *_):
        if name == "numpy":
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt:
                raise ImportError("as some libraries take an exception of a handler")
sys.meta_path.insert(0, Interrupted())
from gestured.{}.cli import main
sys.exit(main())
"""
    command = [sys.executable, "-c", code.format(program), words, "--help"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (status, "", "")


@pytest.mark.parametrize("stopped", [0, INTERRUPTED])
def test_an_error_that_ctrl_c_causes_is_the_end_that_was_asked_for(stopped: int):
    def waits(args: Namespace) -> int:
        lock = threading.Lock()
        with lock:
            lock.release()  # as the `wait` of a condition does
            if args.words == "ctrl-c":
                raise KeyboardInterrupt
        return 0

    def parser() -> Parser:
        top = Parser()
        top.add_argument("words")
        top.set_defaults(run=waits)
        return top

    assert run(parser, ["ctrl-c"], stopped) == stopped
    with pytest.raises(RuntimeError, match="lock"):
        run(parser, ["by itself"], stopped)


def test_what_listens_needs_neither_numpy_nor_a_model():
    code = "import sys, gestured; gestured.Subscriber; print(*{'numpy', 'onnxruntime', 'pydantic'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_types_of_open_and_push_have_public_names():
    """A typed program cannot otherwise say what a function of its own takes."""
    assert get_type_hints(gestured.open)["return"] is gestured.Embedded
    assert get_type_hints(gestured.Embedded.push)["return"] == list[gestured.Event]


@pytest.mark.parametrize("name", sorted({*gestured.__all__} - {"Event"}))
def test_each_name_is_there_when_it_is_used(name: str):
    assert getattr(gestured, name).__name__ == {"Recognizer": "Sensor", "TouchEvent": "Touch"}.get(name, name)
    assert name in dir(gestured)


def test_another_name_is_an_error_as_of_any_module():
    with pytest.raises(AttributeError, match="Recogniser"):
        gestured.Recogniser  # type: ignore[attr-defined]  # noqa: B018


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"model": "cnn_lstn"}, r"cnn_lstn: no shipped model \(these are cnn_lstm, "),
        ({"model": "./none.onnx"}, "none.onnx"),
        ({"gestures": ["wave"]}, "'wave' is no gesture of cnn_lstm, expected any of .*one_tap"),
        ({"gestures": []}, "at least one"),
        ({"gestures": "one_tap"}, r"such as \['one_tap'\]"),
        ({"sensor": "arm rest"}, "'arm rest'"),
        ({"grid": (9, 65)}, "sides of 2 to 64 taxels, found 9 x 65"),
        ({"grid": 9}, "found 9"),
        ({"grid": (9, 9.5)}, r"found \(9, 9\.5\)"),
        ({"rotate": 45}, "found 45"),
        ({"rotate": 90.0}, "rotate: expected 0, 90, 180 or 270, found 90.0"),
        ({"rotate": np.array([90, 180])}, "rotate: expected 0, 90, 180 or 270, found array"),
        ({"mirror": "no"}, "mirror: expected true or false, found 'no'"),
        ({"invert": float("nan")}, "invert: expected true or false, found nan"),
        ({"touch": "yes"}, "touch: expected true or false, found 'yes'"),
        ({"provisional": None}, "provisional: expected true or false, found None"),
        ({"model": None}, "model: expected a name or a path, found None"),
        ({"own_gestures": 5}, "own_gestures: expected a path, found 5"),
        ({"gestures": 5}, "gestures: expected a list of names, found 5"),
        ({"tap_gap_s": 0.7}, "tap_gap_s: expected 0.2 to 0.6 s"),
        ({"tap_gap_s": "0.4"}, "tap_gap_s: expected a number of seconds, found '0.4'"),
        ({"arming": {"by": "one_tap", "seconds": "5"}}, "arming.seconds: expected a number of seconds, found '5'"),
        ({"zones": False}, "zones: expected four numbers for each name, found False"),
        ({"zones": {5: (0, 0, 1, 1)}}, "zones: expected a text as the name of each, found 5"),
        ({"zones": {"a": {"at": (0, 0, 1, 1), "gestures": ["x"]}}}, r"^zones\.a\.gestures: 'x' is no gesture"),
        ({"zones": {("a",): (0, 0, 1, 1)}}, r"zones: expected a text as the name of each, found \('a',\)"),
        ({"thresholds": {"one_tap": True}}, "thresholds: one_tap: expected 0 to 1, found True"),
        ({"thresholds": {"wave": 0.5}}, "thresholds: 'wave' is no gesture of cnn_lstm, expected any of .*one_tap"),
        ({"thresholds": {"one_tap": 5}}, "thresholds: one_tap: expected 0 to 1, found 5"),
        ({"thresholds": 0.5}, "thresholds: expected a confidence for each name, .*found 0.5"),
        ({"strictness": "lax"}, "strictness: expected eager or normal or strict, found 'lax'"),
        ({"sensor": 5}, "sensor: expected 1 to 64 of .* found 5"),
        ({"zones": [("seat", (0, 0, 1, 1))]}, "zones: expected four numbers for each name, found .*seat"),
        ({"arming": {"by": "one_tap", "seconds": 10**400}}, "too large"),
        ({"own_gestures": "n" * 300}, "nnn: cannot be read: File name too long"),
    ],
)
def test_a_mistake_in_opening_is_one_sentence(shelf: Path, wrong: dict[str, Any], words: str):
    with pytest.raises(gestured.GesturedError, match=words):
        gestured.open(**{"model": "cnn_lstm", "sensor": "armrest"} | wrong)


@pytest.mark.parametrize(
    ("t", "values", "words"),
    [
        (1.0, np.zeros((9, 9)), r"after the last frame's, 1\.0 s, found 1\.0"),
        (0.5, np.zeros((9, 9)), r"found 0\.5"),
        (10**400, np.zeros((9, 9)), "found 1000"),
        ("2", np.zeros((9, 9)), "found 2"),
        (float("nan"), np.zeros((9, 9)), "found nan"),
        (2.0, np.zeros((9, 8)), r"grid \(9, 9\) .* shape \(9, 8\)"),
        (2.0, np.zeros(81), r"shape \(81,\)"),
        (2.0, [[1, 2], [3]], "rows of equal length"),
        (2.0, [["a"] * 9] * 9, "numbers"),
        (2.0, None, "numbers"),
    ],
)
def test_a_mistake_in_pushing_is_one_sentence_and_loses_nothing(recognizer: Any, t: float, values: Any, words: str):
    recognizer.push(1.0, np.zeros((9, 9)))
    with pytest.raises(ValueError, match=words):
        recognizer.push(t, values)
    assert recognizer.push(1.1, np.zeros((9, 9), np.uint16)) == []


@pytest.mark.parametrize("take", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_recogniser_is_neither_copied_nor_pickled(recognizer: Any, take: Callable[[Any], Any]):
    with pytest.raises(TypeError, match=r"gestured\.open"):
        take(recognizer)


def test_a_threshold_is_any_real_number(shelf: Path):
    sure: Any = np.float32(0.5)
    gestured.open("cnn_lstm", thresholds={"one_tap": sure})


def test_numbers_of_any_kind_are_times(shelf: Path):
    """A gap is added to times, and times to each other: what is no float is made one at the door."""
    stream = frames("quiet for 1500ms", "press 4,4 0.8 for 130ms", "quiet for 900ms")
    said: list[list[Any]] = []
    for kind in (float, Decimal, np.float64):
        recognizer = gestured.open("cnn_lstm", tap_gap_s=kind("0.4"))
        said.append([event for frame in stream for event in recognizer.push(kind(frame.t), frame.values)])
        said[-1] += recognizer.flush(kind(stream[-1].t + 1))
        assert recognizer.push(kind(100), stream[0].values) == []
    assert len(said[0]) >= 3 and said[0] == said[1] == said[2]


def test_time_goes_on_across_flush_and_reset(recognizer: Any):
    recognizer.push(1.0, np.zeros((9, 9)))
    with pytest.raises(ValueError, match=r"not before the last frame's, 1\.0 s, found 0\.9"):
        recognizer.flush(0.9)
    assert recognizer.flush(1.0) == recognizer.reset() == []
    with pytest.raises(ValueError, match="after the last"):
        recognizer.push(1.0, np.zeros((9, 9)))


def touched(recognizer: Any, **more: Any) -> list[Any]:
    """What comes of a second without a touch and one frame with one."""
    hand = Hand()
    frames = [*hand.idle(2.0), hand.frame(4.0)]
    return [event for n, frame in enumerate(frames) for event in recognizer.push(n / 15, frame, **more)]


def test_an_answer_can_be_had_before_the_next_frame(recognizer: Any, shelf: Path):
    hand = Hand()
    frames = [*hand.idle(2.0), *hand.swipe("left"), *hand.idle(1.0)]
    other = gestured.open("cnn_lstm", sensor="armrest", grid=(9, 9))
    waited, pushed = [], []
    for n, frame in enumerate(frames):
        before = (n - 1) / 15
        if (due := recognizer.due) is not None:
            assert recognizer.wait(before) == []
            waited += recognizer.wait(due + 1e-6)
            assert before < due < n / 15 and recognizer.due is None
        waited += recognizer.push(n / 15, frame)
        pushed += other.push(n / 15, frame)
    assert [type(event) for event in waited] == [Onset, gestured.Gesture, gestured.Release] and waited == pushed
    with pytest.raises(ValueError, match="not before the last frame's"):
        recognizer.wait(0.0)


def test_a_frame_may_say_what_the_sensor_knows_of_it(recognizer: Any):
    (onset,) = touched(recognizer, touches=[Touch(1, 4.0, 4.0)], lost=1)
    assert (onset.sensor, onset.id) == ("armrest", 1) and isinstance(onset, Onset)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("value", "kind"), [(np.nan, "f8"), (1e300, "f8"), (np.inf, "f4"), (np.inf, "f2")])
def test_a_broken_value_costs_its_frame_alone(recognizer: Any, value: float, kind: str):
    """Before and after it all is as it would be without."""
    broken = np.full((9, 9), value, kind)
    hand = Hand()
    events = [e for n, frame in enumerate(hand.idle(2.0)) for e in recognizer.push(n / 15, frame)]
    events += recognizer.push(2.01, broken) + recognizer.push(2.07, hand.frame(4.0))
    assert [type(event) for event in events] == [Onset]


def test_frames_that_are_passed_over_count_as_lost(recognizer: Any):
    """The caller may have lost some himself."""
    hand, lost = Hand(), []
    shown = [*hand.idle(2.0), *hand.swipe("left"), *hand.idle(1.0)]
    for n, frame in enumerate(shown):
        passed_over = n in (32, 33)
        values = np.full((9, 9), np.nan) if passed_over else frame
        events = recognizer.push(n / 15, values, lost=int(n == 33))
        lost += [event.lost for event in events if hasattr(event, "lost")]
    assert lost == [3]


@pytest.fixture(scope="module")
def take() -> Any:
    """A simulated person's gestures, again and again."""
    if not shipped()["cnn_lstm"].exists():
        pytest.skip(f"{shipped()['cnn_lstm']} is not there")
    kinds = ["swipe_left", "double_tap", "swipe_up", "one_tap"] * 6
    return session(Participant(7), SimulatedSensor.nominal(), generator(7), kinds=kinds)


def test_zones_choose_among_the_gestures_that_begin_in_them(take: Any):
    zones = {"volume": {"at": (0.0, 0.5, 1.0, 1.0), "gestures": ["swipe_left"]}, "lamp": (0.0, 0.0, 1.0, 0.5)}
    recognizer = gestured.open("cnn_lstm", zones=zones)
    events = [e for t, values in zip(take.times, take.frames, strict=True) for e in recognizer.push(t, values)]
    heard = {(e.where.zone, e.gesture) for e in events if isinstance(e, gestured.Gesture)}
    assert {gesture for zone, gesture in heard if zone == "volume"} == {"swipe_left"}
    assert {gesture for zone, gesture in heard if zone == "lamp"} >= {"one_tap", "swipe_up"}


def test_no_gesture_counts_before_the_one_that_arms_or_once_a_gate_is_closed(take: Any):
    recognizer, heard = gestured.open("cnn_lstm", arming={"by": "double_tap", "seconds": 3}), []
    for n, (t, values) in enumerate(zip(take.times, take.frames, strict=True)):
        events = recognizer.push(t, values)
        if n == len(take.times) // 2:
            events += recognizer.inhibit(t, "door")
        heard += [
            getattr(e, "reason", "") or e.gesture for e in events if isinstance(e, gestured.Gesture | gestured.Unknown)
        ]
    before = heard[: heard.index("inhibited")]
    assert before.index("disarmed") < before.index("double_tap") < before.index("swipe_up")
    assert set(heard[len(before) :]) == {"inhibited"}


@pytest.mark.parametrize("gate", [5, "", "back door", None], ids=repr)
def test_a_gate_has_a_name_and_another_word_closes_nothing(recognizer: Any, gate: Any):
    with pytest.raises(ValueError, match="gate: expected 1 to 64"):
        recognizer.inhibit(0.0, gate)
    recognizer.inhibit(0.0, "door")
    assert recognizer.allow(0.0, "door")[-1].closed == ()


def test_reset_ends_the_contact_that_is_open(recognizer: Any):
    touched(recognizer)
    assert [getattr(event, "reason", "") for event in recognizer.reset()] == ["restart", ""]


def test_gestures_are_the_models_in_its_order(shelf: Path):
    known = gestured.open("cnn_lstm").gestures
    assert gestured.open("cnn_lstm", gestures=list(reversed(known[:2]))).gestures == known[:2]


def test_a_model_that_cannot_be_used_is_an_error_and_no_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    (tmp_path / "mine.onnx").write_bytes(b"damaged")
    with pytest.raises(gestured.GesturedError, match=r"mine\.onnx"):
        gestured.open(tmp_path / "mine.onnx")
    assert caplog.messages == []


def test_recognisers_share_a_model_as_long_as_its_file_is_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    opened: list[str] = []
    monkeypatch.setattr("gestured.model.opening.Model", lambda data, name: opened.append(name) or Model(data, name))
    path = build(tmp_path / "mine.onnx")
    kept = [gestured.open(path) for _ in range(3)]
    assert opened == ["mine"]
    build(path, version="4", gestures='["one_tap", "swipe_down"]')
    kept.append(gestured.open(path))
    assert opened == ["mine"] * 2 and kept[-1].gestures != kept[0].gestures


def stroke(recognizer: Any, frames: list[Any]) -> list[Any]:
    """What comes of frames between idle seconds, in the sensor's counts."""
    hand = Hand()
    frames = [*hand.idle(2.0), *frames, *hand.idle(1.0)]
    return [event for n, frame in enumerate(frames) for event in recognizer.push(n / 15, frame)]


def test_counts_that_fall_under_pressure_are_turned_round(model: Path):
    plain, inverted = gestured.open(model), gestured.open(model, invert=True)
    frames = [*Hand().idle(2.0), *Hand().swipe("left"), *Hand().idle(1.0)]
    expected = [event for n, frame in enumerate(frames) for event in plain.push(n / 15, np.asarray(frame, float))]
    found = [event for n, frame in enumerate(frames) for event in inverted.push(n / 15, 5000.0 - np.asarray(frame))]
    assert [event.gesture for event in expected if isinstance(event, gestured.Gesture)] == ["swipe_left"]
    assert [type(event) for event in found] == [type(event) for event in expected]
    assert found[1].gesture == "swipe_left" and not stroke(gestured.open(model, invert=True), Hand().swipe("left"))


def test_own_gestures_are_recognised_from_their_file(tmp_path: Path, model: Path):
    """A file as a daemon writes it: enrolled there, recognised here."""
    slash = [Hand().frame(1.0 + k, 1.0 + k) for k in range(7)]
    able = tiny_model.make(tmp_path / "able.onnx", own=tiny_model.own())
    front_end = FrontEnd(9, 9)
    frames = [*Hand().idle(2.0), *slash, *Hand().idle(1.0)]
    found = [one for n, values in enumerate(frames) for one in front_end.push(Frame(n / 15, np.asarray(values)))]
    (segment,) = [one.segment for one in found if isinstance(one, Cut)]
    example = Example.of(segment, open_model(able).metadata.window)
    assert example is not None
    own_file.write(tmp_path / "own.json", {"slash": (example, example)}, "")
    recognizer = gestured.open(able, own_gestures=tmp_path / "own.json", thresholds={"slash": 0.5})
    assert recognizer.gestures[-1] == "slash"
    (answer,) = [event for event in stroke(recognizer, slash) if isinstance(event, gestured.Gesture)]
    assert (answer.gesture, answer.own) == ("slash", True)
    with pytest.raises(gestured.GesturedError, match="tiny has no embedding"):
        gestured.open(model, own_gestures=tmp_path / "own.json")
    (tmp_path / "own.json").write_text("{}")
    with pytest.raises(gestured.GesturedError, match=r"own\.json: is no file of own gestures"):
        gestured.open(able, own_gestures=tmp_path / "own.json")


def test_a_file_of_own_gestures_that_is_missing_is_as_empty_as_to_a_daemon_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    able = tiny_model.make(tmp_path / "able.onnx", own=tiny_model.own())
    recognizer = gestured.open(able, own_gestures=tmp_path / "none.json")
    assert recognizer.gestures == tiny_model.GESTURES
    settings = {"thresholds": {"slash": 0.5}, "zones": {"low": {"at": (0, 0, 1, 0.5), "gestures": ["slash"]}}}
    gestured.open(able, own_gestures=tmp_path / "none.json", **settings)  # it may be enrolled before the next start
    for wrong in ({}, {"own_gestures": tmp_path / "none.json", "thresholds": {"swip_left": 0.5}}):
        with pytest.raises(gestured.GesturedError, match="thresholds: 'sw?[a-z_]+' is no gesture of able"):
            gestured.open(able, **(settings | wrong))
    assert caplog.messages[0] == f"{tmp_path / 'none.json'}: no such file, so there are no gestures of your own yet"


@pytest.mark.parametrize("lost", [float("nan"), -1, 0.5, "1", None])
def test_frames_that_went_missing_are_counted_in_whole_numbers(recognizer: Any, lost: Any):
    with pytest.raises(ValueError, match=rf"lost: expected a count of frames, found {lost!r}"):
        recognizer.push(1.0, np.zeros((9, 9)), lost=lost)
    assert recognizer.push(1.0, np.zeros((9, 9)), lost=np.int64(1)) == []


def test_a_fallback_that_answers_is_a_warning(shelf: Path, caplog: pytest.LogCaptureFixture):
    (shelf / "cnn_lstm.onnx").unlink()
    gestured.open("cnn_lstm")
    assert any("cnn_lstm is put aside" in message for message in caplog.messages)


def test_a_grid_that_is_not_told_is_the_models(tmp_path: Path):
    recognizer = gestured.open(build(tmp_path / "own.onnx"))
    with pytest.raises(ValueError, match=r"grid \(9, 9\)"):
        recognizer.push(0.0, [[0.0]])


def test_strictness_is_an_operating_point_of_the_model_which_says_where_it_has_none(
    model: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    def answer(path: Path, **more: Any) -> str:
        (found,) = [
            event
            for event in stroke(gestured.open(path, **more), Hand().swipe("left"))
            if isinstance(event, gestured.Gesture | gestured.Unknown)
        ]
        return type(found).__name__

    points = json.loads(operating_points(tiny_model.GESTURES))
    points["strict"]["thresholds"]["swipe_left"] = 1.0
    path = tiny_model.make(tmp_path / "mine.onnx", operating_points=json.dumps(points))
    assert [answer(path), answer(path, strictness="eager"), answer(path, strictness="strict")] == [
        "Gesture", "Gesture", "Unknown",
    ]  # fmt: skip
    assert answer(path, strictness="strict", thresholds={"swipe_left": 0.5}) == "Gesture"
    assert caplog.messages == [] and answer(model) == "Gesture" and caplog.messages == []
    assert answer(model, strictness="strict") == "Gesture"
    (said,) = caplog.messages
    assert said.endswith("has no operating points: whatever the strictness, it takes its one threshold")
