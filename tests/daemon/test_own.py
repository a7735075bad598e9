"""Gestures of the user's own: enrolled, recognised, forgotten, by a real daemon that a simulated hand plays to."""

import asyncio
import dataclasses
import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from gestured.client.lines import Refused
from gestured.core.own import Example
from gestured.daemon.own import OwnGestures
from gestured.model import own_file
from gestured.model.ladder import Ladder, ladder_for
from gestured.model.model import Model
from tests.daemon import tiny_model
from tests.daemon.harness import Client, Daemon, Frame, Hand, Sensor, lines_of, running
from tests.several import several
from tests.small_model import WINDOW, segment

Point = tuple[float, float]
Begin = Callable[..., Daemon]
CONFIG, MODEL = "gestured.toml", "tiny.onnx"
NUMBERS = count()


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return tiny_model.make(tmp_path / MODEL, own=tiny_model.own())


@pytest.fixture(scope="module")
def lasting(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon with a configuration, a model and own gestures in its folder."""
    folder = tmp_path_factory.mktemp("own")
    (folder / CONFIG).touch()
    model = tiny_model.make(folder / MODEL, own=tiny_model.own())
    flags = ("--config", folder / CONFIG, "--stale-s", 30)
    with running(folder, model, *flags, env={"STATE_DIRECTORY": str(folder)}) as daemon:
        yield daemon


@pytest.fixture
def daemon(lasting: Daemon) -> Iterator[Daemon]:
    """That daemon. What a test sets and enrols is gone after it; each has sensors of its own."""
    yield lasting
    (lasting.folder / CONFIG).write_text("")
    lasting.ask("reload")
    for name in lasting.ask("gestures")["own"]["gestures"]:
        lasting.ask("forget", name=name)


@pytest.fixture
def begin(tmp_path: Path, model: Path) -> Iterator[Begin]:
    """Starts daemons with a file for own gestures; no sensor falls silent soon."""
    state = {"STATE_DIRECTORY": str(tmp_path)}
    start = partial(Daemon.start, tmp_path, model, "--clock", "sensor", "--stale-s", 30, env=state)
    yield from several(start, Daemon.ends_well)


def stroke(hand: Hand, start: Point, end: Point, frames: int = 7) -> list[Frame]:
    """A straight line from (row, column) to another."""
    parts = [k / (frames - 1) for k in range(frames)]
    return [hand.frame(*(a + part * (b - a) for a, b in zip(start, end, strict=True))) for part in parts]


class Performer(Sensor):
    """A sensor with somebody who knows strokes that are no gestures of the model's."""

    def slash(self, frames: int = 7) -> "Performer":
        """From the top left to the bottom right, and a quiet second."""
        return self._done(stroke(self.hand, (1, 1), (7, 7), frames))

    def backslash(self) -> "Performer":
        """From the bottom left to the top right."""
        return self._done(stroke(self.hand, (7, 1), (1, 7)))

    def hold(self) -> "Performer":
        """A finger that stays for longer than any gesture lasts."""
        return self._done([self.hand.frame(4.0, 4.0 + 0.02 * k) for k in range(120)])

    def _done(self, frames: list[Frame]) -> "Performer":
        self.send(frames, self.hand.idle(1.0))
        return self


class Enrolment:
    """A client that enrols."""

    def __init__(self, daemon: Daemon, name: str, sensor: Sensor, examples: int = 2) -> None:
        self.control = daemon.control()
        self.control.ask("enrol", name=name, sensor=sensor.name, examples=examples)
        self._lines = self.control.lines()

    def line(self) -> dict[str, Any]:
        return next(self._lines)


def ready(daemon: Daemon, name: str | None = None, seed: int = 0) -> Performer:
    """A sensor that the daemon has learned; without a name it is one that no other test has."""
    name = name or f"arm{next(NUMBERS)}"
    client = daemon.client().subscribe("gesture", sensors=[name])
    sensor = Performer(daemon, name, seed=seed)
    sensor.begin().perform("left")
    client.events("gesture", name)
    client.close()
    return sensor


def enrol(daemon: Daemon, sensor: Performer, name: str = "slash", examples: int = 2) -> None:
    """Teach it a stroke."""
    enrolment = Enrolment(daemon, name, sensor, examples)
    for _ in range(examples):
        sensor.slash()
        assert enrolment.line()["kept"] is True
    assert enrolment.line() == {"enrolled": name, "examples": examples}
    enrolment.control.close()


def answer(client: Client, sensor: Performer, perform: Callable[[], object]) -> dict[str, Any]:
    """What becomes of one performance."""
    perform()
    return client.until(lambda line: line["type"] in ("gesture", "unknown", "cancelled"))[-1]


def test_what_was_enrolled_is_recognised_on_every_sensor_without_a_restart(daemon: Daemon) -> None:
    sensor, other = ready(daemon), ready(daemon, seed=5)
    client = daemon.client().subscribe("gesture", "unknown", "cancelled")
    before = answer(client, sensor, sensor.slash)
    assert before["type"] == "unknown"
    enrol(daemon, sensor)
    told = client.until(lambda line: line["type"] == "gestures")[-1]
    assert told == {"type": "gestures", "gestures": [*tiny_model.GESTURES, "slash"]}
    for one in (sensor, other):
        event = answer(client, one, one.slash)
        assert (event["type"], event["gesture"], event["own"], event["sensor"]) == ("gesture", "slash", True, one.name)
        assert 0.5 <= event["confidence"] <= 1
        assert list(event["scores"]) == list(tiny_model.GESTURES)
        assert sum(event["scores"].values()) == pytest.approx(1, abs=1e-3)
    assert answer(client, sensor, sensor.backslash)["type"] == "unknown"
    built_in = answer(client, sensor, lambda: sensor.perform("left"))
    assert (built_in["gesture"], "own" in built_in) == ("swipe_left", False)
    assert daemon.client().hello["gestures"] == [*tiny_model.GESTURES, "slash"]


def test_one_may_be_taken_from_the_model_only_where_it_is_much_nearer(daemon: Daemon) -> None:
    """Slowly drawn, the model is sure that it is a double tap; nothing like it was among those."""
    sensor = ready(daemon)
    client = daemon.client().subscribe("gesture", "unknown", "cancelled")
    assert answer(client, sensor, lambda: sensor.slash(14))["gesture"] == "double_tap"
    enrolment = Enrolment(daemon, "slow", sensor, examples=1)
    assert answer(client, sensor, lambda: sensor.slash(14))["gesture"] == "double_tap"
    assert enrolment.line()["kept"] is True
    assert enrolment.line() == {"enrolled": "slow", "examples": 1}
    client.until(lambda line: line["type"] == "gestures")
    assert answer(client, sensor, lambda: sensor.slash(14))["gesture"] == "slow"
    assert answer(client, sensor, lambda: sensor.perform("right"))["gesture"] == "swipe_right"


def test_each_example_is_judged_at_once(daemon: Daemon) -> None:
    sensor = ready(daemon)
    enrolment = Enrolment(daemon, "slash", sensor)
    for perform, words in (
        (lambda: sensor.perform("tap"), "too short"),
        (lambda: sensor.perform("left"), "the same as swipe_left (0.9"),
        (sensor.hold, "was not over"),
    ):
        perform()
        line = enrolment.line()
        assert (line["example"], line["kept"]) == (1, False)
        assert words in line["reason"]
    sensor.slash()
    assert enrolment.line() == {"example": 1, "kept": True, "reason": None}
    sensor.backslash()
    line = enrolment.line()
    assert (line["example"], line["kept"]) == (2, False)
    assert "not like the others" in line["reason"]
    sensor.slash()
    assert enrolment.line() == {"example": 2, "kept": True, "reason": None}
    assert enrolment.line() == {"enrolled": "slash", "examples": 2}
    again = Enrolment(daemon, "cut", sensor, examples=1)
    sensor.slash()
    line = again.line()
    assert (line["kept"], "the same as slash" in line["reason"]) == (False, True)
    daemon.ask("forget", name="slash")  # which makes room for it
    sensor.slash()
    assert again.line()["kept"] is True and again.line() == {"enrolled": "cut", "examples": 1}


def test_one_enrolment_at_a_time_and_none_outlives_its_client(daemon: Daemon) -> None:
    sensor = ready(daemon)
    for name, examples, words in (
        ("swipe_left", 2, "is a gesture of tiny"),
        ("Slash", 2, "is no gesture's name"),
        ("unknown", 2, "'unknown' is no gesture's name: expected .*, and none of use, unknown, none"),
        ("slash", 6, "expected 1 to 5 examples, found 6"),
    ):
        with pytest.raises(Refused, match=words):
            Enrolment(daemon, name, sensor, examples=examples)
    first = Enrolment(daemon, "slash", sensor)
    sensor.slash()
    assert first.line()["kept"] is True
    with pytest.raises(Refused, match=f"'slash' is being enrolled on {sensor.name}"):
        Enrolment(daemon, "cut", sensor)
    with pytest.raises(Refused, match="a tap already"):
        first.control.ask("enrol", name="cut", sensor=sensor.name)
    daemon.ask("reload")
    assert first.line()["given_up"] == "slash" and daemon.ask("gestures")["own"]["enrolling"] is None
    first = Enrolment(daemon, "slash", sensor)
    sensor.slash()
    assert first.line()["kept"] is True
    first.control.close()
    while daemon.ask("gestures")["own"]["enrolling"] is not None:
        daemon.client().subscribe("status").until(lambda line: line["type"] == "status")
    assert daemon.ask("gestures")["own"]["gestures"] == {}
    enrol(daemon, sensor, "cut")
    assert daemon.ask("gestures")["own"]["gestures"] == {"cut": 2}


def test_what_is_performed_while_a_gate_is_closed_is_answered_too(daemon: Daemon) -> None:
    sensor = ready(daemon)
    enrolment = Enrolment(daemon, "slash", sensor, examples=1)
    daemon.ask("inhibit", gate="door")
    sensor.slash()
    reason = f"{sensor.name} is silent, since gates are closed: door; allow them first"
    assert enrolment.line() == {"example": 1, "kept": False, "reason": reason}
    daemon.ask("allow", gate="door")
    sensor.slash()
    assert enrolment.line()["kept"] is True and enrolment.line() == {"enrolled": "slash", "examples": 1}


def test_the_file_is_private_and_outlives_the_daemon_until_it_is_forgotten(begin: Begin, tmp_path: Path) -> None:
    daemon = begin()
    sensor = ready(daemon)
    enrol(daemon, sensor)
    path = tmp_path / "own-gestures.json"
    assert path.stat().st_mode & 0o777 == 0o600
    kept = json.loads(path.read_text())
    assert kept["model"] == daemon.ask("status")["model"]["sha256"]
    assert len(kept["gestures"]["slash"]) == 2
    assert daemon.stop() == 0
    daemon = begin()
    sensor = ready(daemon)
    client = daemon.client().subscribe("gesture", "unknown", "cancelled")
    assert answer(client, sensor, sensor.slash)["gesture"] == "slash"
    assert daemon.ask("forget", name="slash")["forgotten"] == "slash"
    assert client.until(lambda line: line["type"] == "gestures")[-1]["gestures"] == list(tiny_model.GESTURES)
    assert answer(client, sensor, sensor.slash)["type"] == "unknown"
    assert json.loads(path.read_text())["gestures"] == {}
    with pytest.raises(Refused, match="'slash' is no gesture of your own: nothing is enrolled"):
        daemon.ask("forget", name="slash")


def test_of_two_daemons_with_one_file_the_first_writes_it(begin: Begin, tmp_path: Path) -> None:
    first = begin()
    sensor = ready(first)
    enrol(first, sensor)
    second = begin("--socket", tmp_path / "second.sock")
    other = ready(second)
    client = second.client().subscribe("gesture", "unknown", "cancelled")
    assert answer(client, other, other.slash)["gesture"] == "slash"
    for verb, more in (("enrol", {"name": "cut", "sensor": other.name}), ("forget", {"name": "slash"})):
        with pytest.raises(Refused, match=rf"another gestured \(pid {first.process.pid}\) writes it"):
            second.ask(verb, **more)
    assert f"pid {first.process.pid}" in second.ask("gestures")["own"]["fault"]
    first.ask("forget", name="slash")
    assert first.stop() == 0
    enrolment = Enrolment(second, "cut", other, examples=1)
    other.backslash()
    assert enrolment.line()["kept"] is True
    assert enrolment.line()["enrolled"] == "cut"
    assert own_file.load(tmp_path / "own-gestures.json").gestures.keys() == {"cut"}
    assert second.ask("gestures")["own"] | {"file": ""} == {
        "file": "", "fault": None, "gestures": {"cut": 1}, "off": None, "doubtful": [], "enrolling": None,
    }  # fmt: skip


def test_a_broken_file_is_said_left_alone_and_the_models_gestures_go_on(begin: Begin, tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    path.write_text('{"format": 1, "gestures": {"slash": [{"shape": [3]}]}}')
    daemon = begin("--own-gestures", path)
    sensor = ready(daemon)  # which performs a swipe
    fault = daemon.ask("gestures")["own"]["fault"]
    assert str(path) in fault
    assert "gestures.slash[0]" in fault
    with pytest.raises(Refused, match="is no file of own gestures"):
        Enrolment(daemon, "cut", sensor)
    assert any(line.get("what") == fault for line in lines_of(daemon.stderr()))
    assert '"shape": [3]' in path.read_text()


def test_where_it_cannot_be_written_nothing_changes(begin: Begin) -> None:
    daemon = begin(env={"STATE_DIRECTORY": "", "XDG_STATE_HOME": "", "HOME": ""})
    with pytest.raises(Refused, match="no home: .*--own-gestures FILE"):
        Enrolment(daemon, "slash", ready(daemon), examples=1)
    assert daemon.ask("gestures")["own"]["gestures"] == {}


def test_a_file_that_was_planted_names_no_gesture_of_the_model_twice(
    begin: Begin, tmp_path: Path, example: Example
) -> None:
    own_file.write(tmp_path / "own-gestures.json", {"swipe_left": (example,), "slash": (example,)}, "")
    daemon = begin()
    assert daemon.client().hello["gestures"] == [*tiny_model.GESTURES, "slash"]
    own = daemon.ask("gestures")["own"]
    assert own["gestures"] == {"slash": 1}
    assert "swipe_left is off, since tiny has a gesture of that name" in own["doubtful"]
    assert daemon.ask("forget", name="swipe_left")["forgotten"] == "swipe_left"
    assert own_file.load(tmp_path / "own-gestures.json").gestures.keys() == {"slash"}


def test_another_model_takes_the_examples_over_or_says_that_they_are_off(daemon: Daemon) -> None:
    sensor = ready(daemon)
    enrol(daemon, sensor)
    client = daemon.client().subscribe("gesture", "unknown", "cancelled")
    tiny_model.make(daemon.folder / MODEL, version="2")
    daemon.ask("reload")
    assert daemon.ask("gestures")["own"]["off"] == "tiny has no embedding"
    assert answer(client, sensor, sensor.slash)["type"] == "unknown"
    with pytest.raises(Refused, match="own gestures are off"):
        Enrolment(daemon, "cut", sensor)
    tiny_model.make(daemon.folder / MODEL, version="3", own=tiny_model.own())
    daemon.ask("reload")
    own = daemon.ask("status")["own"]
    assert (own["off"], own["gestures"]) == (None, {"slash": 2})
    assert answer(client, sensor, sensor.slash)["gesture"] == "slash"


def test_thresholds_refractory_times_tests_and_filters_take_own_names(daemon: Daemon) -> None:
    config = daemon.folder / CONFIG
    config.write_text("[gestures.slash]\nrefractory_s = 60\n")
    daemon.ask("reload")
    sensor = ready(daemon)
    enrol(daemon, sensor)
    client = daemon.client().subscribe("gesture", "unknown", "cancelled", gestures=["slash"])
    assert answer(client, sensor, sensor.slash)["gesture"] == "slash"
    assert answer(client, sensor, sensor.slash)["reason"] == "refractory"
    daemon.ask("emit", gesture="slash")
    line = client.line()
    assert (line["gesture"], line["own"], line["test"]) == ("slash", True, True)
    config.write_text("[gestures.slash]\nthreshold = 1.0\n")
    daemon.ask("reload")
    assert answer(client, sensor, sensor.slash)["type"] == "unknown"
    config.write_text("[gestures.swipe_lefft]\nthreshold = 1.0\n")
    with pytest.raises(Refused, match="swipe_lefft"):
        daemon.ask("reload")


def test_one_that_arms_is_heard_first_and_is_not_forgotten_while_it_does(daemon: Daemon) -> None:
    config = daemon.folder / CONFIG
    sensor = ready(daemon)
    config.write_text('[arming]\nby = "slash"\n')
    with pytest.raises(Refused, match="arming.by = 'slash': is no gesture in use, expected any of"):
        daemon.ask("reload")
    enrol(daemon, sensor)
    daemon.ask("reload")
    client = daemon.client().subscribe("gesture", "unknown")
    said = [
        answer(client, sensor, act)
        for act in (lambda: sensor.perform("up"), sensor.slash, lambda: sensor.perform("up"))
    ]
    assert [line.get("gesture", line.get("reason")) for line in said] == ["disarmed", "slash", "swipe_up"]
    with pytest.raises(Refused, match="'slash' is arming.by in the configuration; take it out there and reload first"):
        daemon.ask("forget", name="slash")
    config.write_text("")
    daemon.ask("reload")
    daemon.ask("forget", name="slash")


@pytest.fixture
def example() -> Example:
    found = Example.of(segment(), WINDOW)
    assert found is not None
    return found


@pytest.fixture
def followed(model: Path) -> tuple[OwnGestures, Ladder]:
    """Own gestures that no daemon has; each test tells them their file."""
    return OwnGestures(lambda: None), ladder_for(model)


async def test_what_is_forgotten_during_a_reload_does_not_come_back(
    followed: tuple[OwnGestures, Ladder], tmp_path: Path, example: Example
) -> None:
    own, ladder = followed
    one, other = tmp_path / "one.json", tmp_path / "other.json"
    own_file.write(one, {"slash": (example,), "cut": (example,)}, "")
    own_file.write(other, {"slash": (example,), "wave": (example,)}, "")
    own.follow(ladder, *own.read(one, ladder))

    async def forget_while(path: Path) -> None:
        async with own.writing:  # as a reload does
            found = await asyncio.to_thread(own.read, path, ladder)
            forgetting = asyncio.create_task(own.forget("slash"))
            for _ in range(3):  # with one thread, what `forget` could begin there is over before these are
                await asyncio.to_thread(int)
            own.follow(ladder, *found)
        await forgetting

    asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(1))
    await forget_while(one)
    assert own.gestures.keys() == {"cut"} == own_file.load(one).gestures.keys()
    await forget_while(other)  # which the reload names: it is the one that slash is forgotten in
    assert own.gestures.keys() == {"wave"} == own_file.load(other).gestures.keys()


async def test_a_model_looks_at_each_example_once_and_not_in_the_loop(
    followed: tuple[OwnGestures, Ladder], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, ladder = followed
    looked: list[threading.Thread] = []
    embed = Model.embed
    monkeypatch.setattr(Model, "embed", lambda *what: (looked.append(threading.current_thread()), embed(*what))[1])
    examples = [one for frames in range(4, 9) if (one := Example.of(segment(frames), WINDOW))]
    path = tmp_path / "own.json"
    own_file.write(path, {f"g{k}": (one,) for k, one in enumerate(examples)}, "")
    own.follow(ladder, *own.read(path, ladder))
    assert len(looked) == len(examples)
    for name in ("g0", "g1"):
        await own.forget(name)
    own.follow(ladder, *own.read(path, ladder))
    assert len(looked) == len(examples)
    own_file.write(path, {"new": (dataclasses.replace(examples[0]),)}, "")
    own.follow(ladder, *await asyncio.to_thread(own.read, path, ladder))
    assert len(looked) == len(examples) + 1
    assert looked[-1] is not threading.main_thread()


async def test_a_fallback_that_comes_to_answer_looks_at_the_examples_beside_the_loop(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, example: Example
) -> None:
    below = tiny_model.make(tmp_path / "below.onnx", version="2", own=tiny_model.own())
    ladder, own = ladder_for(model, [below]), OwnGestures(lambda: None)
    own_file.write(tmp_path / "own.json", {"slash": (example,)}, "")
    own.follow(ladder, *own.read(tmp_path / "own.json", ladder))
    assert ladder.classify(example.segment()).own is not None
    monkeypatch.setattr(ladder.model, "classify", None)  # it fails from now on
    first = ladder.classify(example.segment())
    assert (first.model, first.own) == ("below", None)
    while ladder.own.made(ladder.model) is None:
        await asyncio.sleep(0.01)
    assert ladder.classify(example.segment()).own is not None
