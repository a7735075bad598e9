"""gesturectl enrol, gestures and forget, and a tape of own gestures that is played again."""

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from gestured.control.status import own_faults
from tests.control.conftest import SLOW
from tests.daemon import tiny_model
from tests.daemon.harness import Daemon, running
from tests.daemon.test_own import Performer, ready
from tests.sockets import FakeDaemon


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon that knows how to learn."""
    folder = tmp_path_factory.mktemp("own")
    model = tiny_model.make(folder / "tiny.onnx", own=tiny_model.own())
    with running(folder, model, *SLOW, "--own-gestures", folder / "mine.json") as daemon:
        yield daemon


@pytest.fixture(scope="module")
def sensor(daemon: Daemon) -> Performer:
    return ready(daemon, "armrest")


def begun(start, daemon: Daemon, *flags: object, sensor: str = "armrest"):
    """`gesturectl enrol slash`, once the daemon waits for examples."""
    process = start("enrol", "slash", "--sensor", sensor, *flags, "--control", daemon.ready["control"])
    status = daemon.client().subscribe("status")
    while daemon.ask("gestures")["own"]["enrolling"] is None:
        status.line()
    return process


def test_a_gesture_is_enrolled_listed_and_forgotten(start, ctl, daemon: Daemon, sensor: Performer) -> None:
    process = begun(start, daemon, "--examples", 1, "--json")
    sensor.perform("left")
    sensor.slash()
    first, *others = [json.loads(line) for line in process.communicate(timeout=30)[0].splitlines()]
    assert process.returncode == 0
    assert (first["example"], first["kept"]) == (1, False)
    assert "the same as swipe_left" in first["reason"]
    assert others == [{"example": 1, "kept": True, "reason": None}, {"enrolled": "slash", "examples": 1}]
    status, out, _ = ctl("gestures")
    assert status == 0
    assert "swipe_left " in out and "slash " in out and "your own, 1 examples" in out
    assert json.loads(ctl("gestures", "--json")[1])["own"]["gestures"] == {"slash": 1}
    assert "slash" in json.loads(ctl("status", "--json")[1])["own"]["gestures"]
    status, _, err = ctl("enrol", "slash", "--sensor", "armrest")
    assert (status, "enrolled already" in err) == (1, True)
    assert ctl("forget", "slash")[:2] == (0, "forgot slash\n")
    status, _, err = ctl("forget", "slash")
    assert (status, err.count("\n"), "is no gesture of your own" in err) == (1, 1, True)


def test_a_person_reads_what_becomes_of_each_example(start, ctl, daemon: Daemon, sensor: Performer) -> None:
    process = begun(start, daemon, "--examples", 2)
    sensor.slash().backslash().slash()
    out = process.communicate(timeout=30)[0].decode()
    assert process.returncode == 0
    assert "1 of 2: kept" in out and "2 of 2: not kept, not like the others" in out and "enrolled slash" in out
    assert max(map(len, out.splitlines())) <= 120
    assert ctl("forget", "slash")[0] == 0


def test_ctrl_c_gives_up_and_nothing_has_changed(start, ctl, daemon: Daemon, sensor: Performer) -> None:
    process = begun(start, daemon)
    sensor.slash()
    while b"1 of 3: kept" not in process.stdout.readline():
        pass
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 1
    assert json.loads(ctl("gestures", "--json")[1])["own"]["gestures"] == {}


def test_ctrl_c_before_the_daemon_has_begun_gives_up_too(start, fake: FakeDaemon) -> None:
    process = start("enrol", "slash", "--sensor", "armrest", "--control", fake.path)
    waiting, _ = fake.listener.accept()
    assert b"enrol" in waiting.recv(4096)  # as behind a reload, which may take seconds
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 1
    waiting.close()


def test_a_tape_holds_own_gestures_and_gates_and_replays_to_the_same_events(
    start, ctl, run, daemon: Daemon, recorded
) -> None:
    teacher, seat = ready(daemon, "teacher"), Performer(daemon, "seat", seed=7)
    process = begun(start, daemon, "--examples", 1, sensor="teacher")
    teacher.slash()
    assert process.wait(30) == 0
    seat.begin()
    ctl("recalibrate", "--sensor", "seat")  # so that the tape knows the sensor, too
    ctl("inhibit", "--all", "--gate", "door")

    def perform() -> None:
        client = daemon.client().subscribe("release", sensors=["seat"])
        seat.begin()
        seat.slash()
        client.events("release", "seat")
        ctl("allow", "--all", "--gate", "door")
        seat.slash().backslash().perform("up")
        seat.slash()
        client.events("release", "seat", 4)

    path, _ = recorded(perform)
    model = next(daemon.folder.glob("*.onnx"))
    events = [json.loads(line) for line in run("replay", path, "--model", model, "--json")[1].splitlines()]
    answers = [one.get("gesture") or one["reason"] for one in events if one["type"] in ("gesture", "unknown")]
    assert answers == ["inhibited", "slash", "confidence", "swipe_up", "slash"]
    assert ctl("forget", "slash")[0] == 0


def test_status_and_doctor_say_what_is_wrong_with_own_gestures(run, serve, tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    path.write_text("{")
    daemon = serve("--own-gestures", path)
    status, out, _ = run("status", "--control", daemon.ready["control"])
    assert status == 0
    assert f"own gestures: {path}: is no file of own gestures: " in out
    _, out, _ = run("doctor", "--json", "--control", daemon.ready["control"])
    (found,) = [one for one in map(json.loads, out.splitlines()) if "own gestures" in one["what"]]
    assert found["level"] == "warn"
    assert f"{path}: is no file" in found["what"]
    assert "gesturectl reload" in found["remedy"]


def test_own_gestures_that_are_off_or_alike_are_said() -> None:
    own = {"fault": None, "gestures": {"slash": 3}, "off": "forest has no embedding", "doubtful": ["a is like b"]}
    assert own_faults({"own": own}) == ["forest has no embedding", "a is like b"]
    assert own_faults({"own": own | {"gestures": {}, "doubtful": []}}) == []
    assert own_faults({}) == []
