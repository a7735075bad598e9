"""The judge of everyday life: one rule for simulated days, the other generator's hours, recordings and tapes."""

import errno
import json
import os
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from experiments.everyday import lived as foreign_lived
from experiments.foreign import session
from gestured.core.events import Gesture, Onset
from gestured.core.facts import events_of
from gestured.core.frames import Frame
from gestured.core.listening import Arming
from gestured.core.scene import Scene, Setup
from gestured.core.sensor import ABSENT_S, Sensor
from gestured.core.where import Zone
from gestured.lab.digest import file_digest
from gestured.lab.everyday import FIRST, command, stretches
from gestured.lab.everyday.hours import FEW, HELD, LEVELS, NOT_READY, RESTARTING, Heard, hear, judged, points_of
from gestured.lab.everyday.picture import draw
from gestured.lab.everyday.report import figures, tables
from gestured.lab.everyday.stretches import HEARD, WAKING, WOKEN, Stretch, lived
from gestured.lab.made_of import LINE
from gestured.lab.table import Table
from gestured.model.shipped import LADDER, shipped
from gestured.record.arrays import write
from gestured.record.judge import NONE, UNNAMED, Performed, Said
from gestured.record.recordings import Recordings
from gestured.record.replay import Replay, opened
from tests.lab.conftest import Run
from tests.small_model import GESTURES, STRICTER, build, operating_points
from tests.small_recording import untouched

ROOT = Path(__file__).resolve().parents[2]
SHORT_S = 240.0


@cache
def afternoon() -> Heard:
    """Some minutes of a day, heard by all shipped models."""
    return hear(lived(FIRST, SHORT_S), command.rungs("cnn_lstm"), "normal")


@pytest.fixture
def everyday(run: Run) -> Run:
    """The command: exit status, standard output, standard error."""
    return partial(run, "everyday", "--jobs", 1)


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command starts no processes."""
    monkeypatch.setattr(command, "in_processes", lambda make, todo, *_: map(make, todo))


@pytest.fixture
def said(everyday: Run, here: None) -> Callable[..., Any]:
    """What the command says as JSON."""
    return lambda *arguments: json.loads(everyday("--json", *arguments)[1])


def test_what_a_recording_does_not_tell_is_false_and_what_it_tells_is_judged(
    tmp_path: Path, said: Callable[..., Any]
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
    for name in (UNNAMED, "knock"):  # nobody knows what it was, or it is a gesture of the user's own, to be enrolled
        marks["event_labels"] = np.full(len(events), name)
        write(tmp_path / f"{name}.npz", Recordings(**dict(silent.present()), **marks))
        found = said("--recordings", tmp_path / f"{name}.npz")
        assert (found["meant"], found["false_per_hour"], found["provisional_false_per_hour"]) == (0, 0.0, 0.0)
    unknown = said("--recordings", tmp_path / "silent.npz")
    known = said("--recordings", tmp_path / "told.npz")
    assert known["right"] > 0.8 and known["false_per_hour"] < 0.2 * unknown["false_per_hour"]
    assert unknown["false_per_hour"] * unknown["hours"] >= 0.8 * len(events)
    assert (unknown["meant"], unknown["right"]) == (0, None) and known["meant"] == len(events)


@pytest.mark.parametrize(("label", "false"), [(UNNAMED, 0), (NONE, 1)])
def test_the_answer_to_a_touch_just_after_a_gesture_is_not_the_gestures(label: str, false: int) -> None:
    """As `gesturectl tune` has it: what is overlapped comes before what is merely near."""
    one = session(9100, "nominal", 12.0, 0.0)
    first = one["events"][0]
    end = float(first["onset"]) - 0.2
    frames = [Frame(float(t), values) for t, values in zip(one["times"], one["frames"], strict=True) if t < end + 3.0]
    gesture, touch = Performed("swipe_up", "", end - 0.5, end), Performed(label, "", end + 0.2, float(first["release"]))
    life = Stretch("a", "b", frames, Setup(grid=(9, 9)), [gesture], [], others=[touch])
    (model, *_) = command.rungs("cnn_lstm")
    counts = judged([hear(life, [model], "normal")], model.name, 0.0).said
    assert (counts["missed"], counts["false"]) == (1, false)


def test_a_touch_beside_the_marked_one_in_its_recording_is_false(tmp_path: Path, said: Callable[..., Any]) -> None:
    one = session(9100, "nominal", 60.0, 0.0)
    second = one["events"][1]
    count = int(np.searchsorted(one["times"], second["release"] + 1.5))
    marks = [np.searchsorted(one["times"], [second[name]]) for name in ("onset", "release")]
    made = Recordings(
        one["frames"][:count], one["times"][:count], np.array([0, count]), np.array([second["label"]]), np.array([0])
    )
    write(tmp_path / "a.npz", replace(made, onsets=marks[0], releases=marks[1]))
    found = said("--recordings", tmp_path / "a.npz")
    assert (found["right"], sum(of["false"] for of in found["gestures"].values())) == (1.0, 1)


def test_one_frame_is_no_place_a_blink_is_no_hour_and_milliseconds_are_no_seconds(
    tmp_path: Path, everyday: Run, said: Callable[..., Any]
) -> None:
    for name, count, rate_hz in (("one", 1, 15.0), ("blink", 9, 15.0), ("good", 60, 15.0), ("ms", 60, 0.015)):
        write(tmp_path / f"{name}.npz", untouched(np.arange(count) / rate_hz))
    found = said("--recordings", tmp_path / "one.npz", tmp_path / "good.npz")
    assert list(found["places"]) == ["good"] and found["hours"] == round(59 / 15 / 3600, 4)
    for name, reason in (
        ("blink", "expected at least 1 s of frames"),
        ("ms", "times of recording 0: expected 2 to 2500 frames a second, found 0.015; are these seconds?"),
    ):
        status, _, err = everyday("--recordings", tmp_path / f"{name}.npz")
        assert status == 1 and f"{name}.npz: {reason}" in err


def test_a_night_in_which_a_sensor_sent_nothing_shows_nothing(tmp_path: Path, said: Callable[..., Any]) -> None:
    """Not that nothing false is said in it."""
    write(tmp_path / "night.npz", untouched(np.concatenate([np.arange(600) / 15, 36_000 + np.arange(600) / 15])))
    found = said("--recordings", tmp_path / "night.npz")
    assert found["hours"] == round((2 * 599 / 15 + ABSENT_S) / 3600, 4)


def test_of_a_tape_all_that_the_daemon_would_publish_is_false(everyday: Run) -> None:
    path = ROOT / "docs" / "demo.mcap"
    tape, maker = opened(path)
    (model, *_) = command.rungs("cnn_lstm")
    events = list(Replay(tape, maker.scene, model).events())
    names = [event.gesture for event in events if isinstance(event, Gesture)]
    found = json.loads(everyday("--json", "--recordings", path)[1])  # by a process of its own
    assert {name: of["false"] for name, of in found["gestures"].items() if of["false"]} == {
        name: names.count(name) for name in names
    }
    onsets = sum(isinstance(event, Onset) for event in events)
    assert found["contacts"] == onsets


def test_the_zones_of_a_tape_decide(monkeypatch: pytest.MonkeyPatch, said: Callable[..., Any]) -> None:
    tape, maker = opened(ROOT / "docs" / "demo.mcap")
    silent = {"left": Zone((0.0, 0.0, 0.5, 1.0), ())}
    maker = replace(maker, scene=replace(maker.scene, sensors={"armrest": Setup(zones=silent)}))
    monkeypatch.setattr(stretches, "opened", lambda _: (tape, maker))
    events = Replay(tape, maker.scene, *command.rungs("cnn_lstm")[:1]).events()
    names = [event.gesture for event in events if isinstance(event, Gesture)]
    found = said("--recordings", ROOT / "docs" / "demo.mcap")["gestures"]
    assert {name: of["false"] for name, of in found.items() if of["false"]} == {n: names.count(n) for n in names} != {}


def test_files_of_one_name_in_two_folders_are_neither_one_person_nor_one_place(
    tmp_path: Path, said: Callable[..., Any]
) -> None:
    paths, tape = [tmp_path / folder / "day.mcap" for folder in ("monday", "tuesday")], ROOT / "docs" / "demo.mcap"
    for n, path in enumerate(paths):
        path.parent.mkdir()
        path.write_bytes(tape.read_bytes()[: tape.stat().st_size - n])  # the second one is cut off
    found = said("--recordings", *paths)
    assert found["people"] == 2 and list(found["places"]) == [f"{path}: armrest" for path in paths]
    for n, path in enumerate(paths):
        write(path.with_suffix(".npz"), untouched(np.arange(60 + n) / 15))
    paths = [path.with_suffix(".npz") for path in paths]
    assert list(said("--recordings", *paths)["places"]) == [str(path) for path in paths]


@pytest.mark.parametrize("lived", [lambda: lived(FIRST, SHORT_S), lambda: foreign_lived("nominal", FIRST)])
def test_the_hours_of_either_generator_carry_their_truth(lived: Any) -> None:
    life = lived()
    frames = list(life.frames)
    last = frames[-1].t
    assert frames[0].values.shape == life.setup.grid == (9, 9) and life.contacts >= 0.02 * last
    assert life.meant and all(0 < act.onset < act.offset < last for act in [*life.meant, *life.taps])
    assert all(act.label != NONE for act in life.meant) and all(act.label == NONE for act in life.taps)


def test_what_counts_at_the_thresholds_is_what_a_daemon_publishes() -> None:
    (model, *_) = command.rungs("cnn_lstm")
    life = lived(FIRST, SHORT_S)
    sensor = Sensor("lab", Scene(model.gestures, (9, 9)), model)
    told = [one for frame in life.frames for one in sensor.push(frame)] + sensor.flush(SHORT_S + 5)
    published = [event.gesture for event in events_of(told) if isinstance(event, Gesture)]
    counts = judged([afternoon()], model.name, points_of(model)["normal"]).said
    assert len(published) == counts["right"] + counts["wrong"] + counts["false"] + counts["apart"] > 0
    assert counts["right"] + counts["wrong"] + counts["missed"] == len(life.meant)


def test_an_armed_sensor_says_nothing_but_after_the_gesture_that_arms_it() -> None:
    life = lived(FIRST, SHORT_S, "double_tap")
    assert [act.label for act in life.meant[::2]] == ["double_tap"] * (len(life.meant) // 2) and life.meant
    heard = hear(life, command.rungs("cnn_lstm")[:1], "normal", Arming("double_tap"))
    armed = 0
    for one in heard.said["cnn_lstm"]:
        armed = armed or one.gesture == "double_tap"
        assert armed
    lay = figures([heard], command.rungs("cnn_lstm")[:1], "normal", published=True)["lay"]
    assert 0 < lay[WOKEN]["right"] <= lay[HEARD]["right"] <= 1
    assert lay[HEARD]["meant"] == round(lay[WAKING]["right"] * lay[WAKING]["meant"])


def test_a_higher_threshold_says_less_and_misses_more() -> None:
    found = figures([afternoon()], command.rungs("cnn_lstm"), "normal")
    assert list(found["curves"]) == list(found["points"]) == list(LADDER)
    for rows in found["curves"].values():
        assert [row["threshold"] for row in rows] == LEVELS
        assert (np.diff([row["false_per_hour"] for row in rows]) <= 0).all()
        assert (np.diff([row["missed"] for row in rows]) >= 0).all()
    assert found["points"]["cnn_lstm"]["normal"] == {key: found[key] for key in ("false_per_hour", "wrong", "missed")}
    assert sum(of["false"] for of in found["gestures"].values()) == round(found["false_per_hour"] * found["hours"])
    assert sum(of["meant"] for of in found["lay"].values()) == found["meant"]


def made(*answers: Said, meant: list[Performed], person: str = "a", seconds: float = 3600.0) -> Heard:
    return Heard("table", person, 50, meant, {"m": list(answers)}, seconds)


def test_each_thing_that_is_said_is_counted_once() -> None:
    swipe, lost, late = (Performed("swipe_up", "nothing", t, t + 1) for t in (1.0, 2.0, 3.0))
    tap = Performed(NONE, "idle_tap", 9.0, 9.1)
    one = made(
        Said("swipe_up", 0.9, swipe), Said("swipe_up", 0.9, swipe), Said("one_tap", 0.9, late),
        Said("swipe_up", 0.4, lost), Said("one_tap", 0.9, tap), Said("circle_clockwise", 0.9, None),
        meant=[swipe, lost, late],
    )  # fmt: skip
    found = judged([one], "m", 0.5)
    assert found.said == {"right": 1, "wrong": 1, "missed": 1, "false": 2, "apart": 1}
    assert found.false == {"swipe_up": 1, "circle_clockwise": 1}
    assert judged([one], "m", {"swipe_up": 0.3, "one_tap": 0.95, "circle_clockwise": 0.95}).said["right"] == 2


def test_the_interval_is_over_people_and_says_what_few_hours_cannot() -> None:
    false = Said("one_tap", 0.9, None)
    silent, even = (judged([made(*answers, meant=[], person=str(n)) for n in range(10)], "m", 0.5)
                    for answers in ([], [false, false]))  # fmt: skip
    assert silent.interval() == pytest.approx((0.0, 0.3)) and even.interval() == (2.0, 2.0)
    uneven = judged([made(*[false] * (n % 2) * 4, meant=[], person=str(n)) for n in range(10)], "m", 0.5)
    low, high = uneven.interval()
    assert low < 2.0 < high
    lone = judged([made(*[false] * 20, meant=[], person="a", seconds=3600.0 * FEW)], "m", 0.5)
    low, high = lone.interval()
    assert 2.0 < low < 4.0 < high < 6.5


def test_where_a_sensor_is_deaf_is_told() -> None:
    (model, *_) = command.rungs("cnn_lstm")
    rng = np.random.default_rng(5)
    frames = rng.normal(1000.0, 2.0, (40 * 15, 9, 9))
    frames[75:285, 4:6, 4:6] += 400.0  # 14 s
    frames[450:] -= 600.0  # another zero: a sensor that began anew
    stream = [Frame(n / 15, values) for n, values in enumerate(frames)]
    deaf = hear(Stretch("a", "b", stream, Setup(grid=(9, 9)), [], []), [model], "normal").deaf_s
    assert 0.5 < deaf[NOT_READY] < 2.0 and 0.0 < deaf[HELD] < 14.0 and 0.0 < deaf[RESTARTING] < 5.0


def test_operating_points_of_a_model_are_marked_and_those_it_has_not_are_refused(
    tmp_path: Path, everyday: Run, said: Callable[..., Any]
) -> None:
    path = build(tmp_path / "mine.onnx", operating_points=operating_points())
    found = said(path, "--strictness", "strict", "--recordings", ROOT / "docs" / "demo.mcap")
    assert list(found["points"]) == ["mine"] and list(found["gestures"]) == list(GESTURES)  # others know other gestures
    points = found["points"]["mine"]
    assert list(points) == list(STRICTER) and points["strict"]["false_per_hour"] == found["false_per_hour"]
    assert points["strict"]["false_per_hour"] <= points["eager"]["false_per_hour"] > 0
    build(tmp_path / "old.onnx")
    status, _, err = everyday(tmp_path / "old.onnx", "--strictness", "strict")
    assert status == 1 and "--strictness strict: old has no operating points, expected normal" in err


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--seconds", "0"], "--seconds: expected more than 0, at most 3600, found 0"),
        (["--recordings", "a.npz", "--document", "p.md"], "--document: expected no --recordings"),
        (["--recordings", "a.npz", "./a.npz"], "a.npz: expected each file once"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(everyday: Run, flags: list[str], words: str) -> None:
    status, _, err = everyday(*flags)
    (line,) = [line for line in err.splitlines() if line.startswith("gestured-lab: ")]
    assert status == 1 and words in line


def test_the_page_and_the_picture_are_written(tmp_path: Path, everyday: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "in_processes", lambda *_: [[afternoon()]])
    page, curve = tmp_path / "page.md", tmp_path / "curve.svg"
    page.write_text("before\n<!-- everyday: begin -->\nold\n<!-- everyday: end -->\nafter\n")
    status, out, _ = everyday("--document", page, "--svg", curve)
    printed = [line for line in out.splitlines() if line.startswith("| ")]
    assert status == 0
    lines = page.read_text().splitlines()
    assert [line for line in lines if line.startswith("| ")] == printed and (lines[0], lines[-1]) == ("before", "after")
    match = LINE.fullmatch(lines[2])
    assert match and [part.split()[0] for part in match[2].split(", ")] == [
        *(path.name for path in shipped().values()), "curve.svg",
    ]  # fmt: skip
    words = {text.text for text in ElementTree.fromstring(curve.read_text()).iter("{http://www.w3.org/2000/svg}text")}
    assert {*LADDER, "normal", "0.5 an hour"} <= words
    assert curve.read_text() == draw(figures([afternoon()], command.rungs("cnn_lstm"), "normal"))


def test_a_page_names_the_file_that_was_judged_also_where_a_shipped_one_is_called_so(
    tmp_path: Path, everyday: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = build(tmp_path / "lstm.onnx")
    quiet = Heard("table", "a", 0, [], {"lstm": []}, 1800.0)
    monkeypatch.setattr(command, "in_processes", lambda *_: [[quiet]])
    page = tmp_path / "page.md"
    page.write_text("<!-- everyday: begin -->\n<!-- everyday: end -->\n")
    assert everyday(mine, "--document", page)[0] == 0
    match = LINE.fullmatch(page.read_text().splitlines()[1])
    assert match and match[2] == f"lstm.onnx {file_digest(mine)[:12]}"


def test_a_disk_without_room_for_the_picture_takes_no_figures_away(
    tmp_path: Path, everyday: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(command, "in_processes", lambda *_: [[afternoon()]])
    monkeypatch.setattr(os, "fsync", full)
    status, out, err = everyday("--svg", tmp_path / "curve.svg")
    assert status == 1 and "### By gesture" in out and list(tmp_path.iterdir()) == []
    assert err == f"gestured-lab: {tmp_path}/curve.svg: No space left on device\n"


def test_a_reader_who_has_gone_takes_no_file_away(
    tmp_path: Path, everyday: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: object, **__: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr(command, "in_processes", lambda *_: [[afternoon()]])
    monkeypatch.setattr("gestured.lab.written.say_drawn", gone)
    assert everyday("--svg", tmp_path / "curve.svg")[0] == 0
    assert (tmp_path / "curve.svg").exists()


def test_many_false_gestures_an_hour_are_no_power_of_ten() -> None:
    shown = str(Table("t", ("many", "all", "few"), [(1371.4, 99.6, 1.27)]))
    assert "| 1371 | 100 | 1.3 |" in shown


def test_hours_in_which_nothing_is_said_have_a_table_and_a_picture() -> None:
    models = command.rungs("cnn_lstm")
    quiet = Heard("table", "a", 0, [], {model.name: [] for model in models}, 1800.0)
    found = figures([quiet], models, "normal")
    assert (found["false_per_hour"], found["high"], found["right"]) == (0.0, 6.0, None)
    assert "Nothing false was said" in "".join(map(str, tables(found, "recorded"))) and "svg" in draw(found)
