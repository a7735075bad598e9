"""gesturectl's questions to a real daemon: status, doctor, sniff, emit, reload, recalibrate."""

import json
import os
import re
import signal
import socket
from pathlib import Path

import numpy as np
import pytest

from gestured.client import address
from gestured.control.doctor import _buffer, _clock, _permissions, _port
from gestured.control.findings import BUFFER_BYTES, model_finding
from gestured.control.status import screen
from gestured.core.address import Address
from tests import encoding
from tests.daemon import tiny_model
from tests.daemon.harness import Daemon, Hand, Sensor, floats
from tests.sockets import FakeDaemon, meanwhile, sending


def test_status_shows_sensors_model_and_answers(ctl, daemon: Daemon) -> None:
    client = daemon.client()
    Sensor(daemon, "seat").begin().perform("left")
    client.events("gesture", "seat")
    status, out, err = ctl("status")
    assert status == 0, err
    assert re.search(r"^seat +ok +15\.\d .* 1  9x9$", out, re.MULTILINE), out
    assert "model tiny 1" in out and re.search(r"seat +swipe_left +0\.\d\d$", out, re.MULTILINE)
    found = json.loads(ctl("status", "--json")[1])
    assert found["sensors"]["seat"]["gestures"] == 1 and found["ready"]["ready"] is True
    assert found["answers"]["gestures"]["swipe_left"] >= 1 and found["flight_recorder"]["held_bytes"] > 0
    assert found["addresses"]["listen"] == daemon.ready["listen"] and found["model"]["rung"] == 0


def test_status_of_a_daemon_that_is_not_ready(daemon: Daemon) -> None:
    told = daemon.ask("status")
    silent = {"state": "no_data", "rate_hz": 0.0, "jitter_s": 0.0, "bad_taxels": 0, "drift": 0.0, "grid": "9x9"}
    told |= {"sensors": {f"s{i}": silent for i in range(20)}, "input": {"dropped": {"size": 4}, "kernel_drops": 0}}
    told["sensors"]["s19"] = silent | {"state": "faulty"}
    told["ready"] = {"ready": False, "reason": "no model could classify the last segment"}
    told["model"] |= {"asked": "cnn_lstm", "degraded": True, "failures": 2}
    told["answers"]["cancelled"] = {"held": 2}
    text = "\n".join(screen(told))
    assert "not ready: no model could classify" in text and "a fallback for cnn_lstm, 2 failures" in text
    assert "s19 " not in text and "and 8 more: gesturectl doctor" in text  # none of them is well
    told["sensors"] |= {f"s{i}": silent | {"state": "ok"} for i in range(12)}
    assert re.search("^s19 +faulty", "\n".join(screen(told)), re.MULTILINE)  # it comes before those that are
    assert "4 size" in text and "2 held" in text


@pytest.mark.parametrize(
    ("shares", "unlike", "words"),
    [
        ({"unknown": 0.8}, [], "nothing to say yet (40 gestures)"),  # most touches of everyday life are no gestures
        ({"strength": 0.04, "unknown": 0.8}, [], "the last 40 gestures are like those of the training"),
        ({"strength": 0.5, "duration_s": 0.4}, ["strength", "duration_s"],
         "the last 40 gestures are unlike those of the training in strength (50 %), duration (40 %): "
         "gesturectl doctor says more"),
    ],
)  # fmt: skip
def test_status_says_one_thing_of_the_shift(
    daemon: Daemon, shares: dict[str, float], unlike: list[str], words: str
) -> None:
    shift = {"gestures": 40, "outside": shares, "unlike": unlike}
    (line,) = [line for line in screen(daemon.ask("status") | {"shift": shift}) if line.startswith("shift:")]
    assert line == f"shift: {words}"


def test_without_a_daemon_each_says_so_in_one_line(run, tmp_path: Path) -> None:
    for command in (["status"], ["listen"], ["emit", "one_tap"], ["view"], ["record", tmp_path / "x.mcap"]):
        status, out, err = run(*command, "--control", tmp_path / "none.ctl")
        assert status == 1 and out == "" and err.count("\n") == 1
        assert "no daemon on" in err and "--control" in err
    assert not (tmp_path / "x.mcap").exists()


def test_a_test_event_is_published_and_numbered(ctl, daemon: Daemon) -> None:
    assert ctl("emit", "swipe_up", "--sensor", "door")[:2] == (
        0,
        "published swipe_up of door as #1, marked as a test\n",
    )
    status, _, err = ctl("emit", "wink")
    assert status == 1 and "wink" in err and "swipe_up" in err


def test_recalibrate_and_reload(ctl, daemon: Daemon) -> None:
    client = daemon.client()
    Sensor(daemon, "belt").begin().perform("left")
    client.events("gesture", "belt")
    assert "belt" in ctl("recalibrate", "--sensor", "belt")[1]
    status, _, err = ctl("recalibrate", "--sensor", "nobody")
    assert status == 1 and "nobody" in err and "belt" in err
    assert ctl("reload")[1] == "reloaded; tiny answers\n"
    path = Path(daemon.ready["control"]).with_name("tiny.onnx")
    good = path.read_bytes()
    path.write_bytes(good[:500])
    status, _, err = ctl("reload")
    path.write_bytes(good)
    assert status == 1 and str(path) in err and "nothing has changed" in err


def test_reload_names_what_only_a_restart_changes(told, fake: FakeDaemon) -> None:
    answer = {"ok": True, "model": "tiny", "awaiting_restart": ["listen", "metrics"]}
    status, out, _ = told([answer], "reload", "--control", fake.path)
    assert status == 0 and re.search(r"tiny answers; .*restart.*: listen, metrics\n$", out)


def test_sniff_shows_what_reaches_the_daemon_and_what_to_set(start, daemon: Daemon) -> None:
    sniffer = start("sniff", "--seconds", "60", "--control", daemon.ready["control"], "--json")
    sensor, hand = Sensor(daemon, "odd"), Hand()
    with socket.socket(type=socket.SOCK_DGRAM) as sender:
        sender.connect(daemon.address)
        while daemon.ask("status")["taps"] == 0:
            pass
        for n in range(20):
            sender.send(floats("/textile/odd/matrix", hand.frame(), n))
        sender.send(b"rubbish!")
    sensor.begin()
    while daemon.ask("status")["sensors"].get("odd") is None:
        pass
    sniffer.send_signal(2)
    out, _ = sniffer.communicate(timeout=30)
    found = json.loads(out)
    message = next(m for m in found["messages"] if m["address"] == "/textile/odd/matrix")
    assert (message["types"], message["count"], len(message["sources"])) == ("f*81", 20, 1)
    assert found["errors"] == {"not_osc": 1}


@pytest.mark.parametrize("command", ["record", "record --seconds 0.2", "sniff", "sniff --seconds 0.2"])
def test_what_a_daemon_that_hangs_streams_can_be_ended(run, daemon, fake, monkeypatch, command: str) -> None:
    monkeypatch.setattr("gestured.control.address.LAST_S", 0.1)
    scene = daemon.ask("tap")

    def hang() -> None:
        fake.accept(scene)
        fake.request()
        if "--seconds" not in command:
            os.kill(os.getpid(), signal.SIGINT)

    files = [fake.path.with_suffix(".mcap")] if "record" in command else []
    with meanwhile(hang):
        status, out, _ = run(*command.split(), *files, "--control", fake.path)
    assert (status, "0 packets" in out) == (int("sniff" in command), True)


def test_doctor_finds_what_is_wrong_and_says_what_to_do(ctl, daemon: Daemon, monkeypatch) -> None:
    monkeypatch.setattr("gestured.control.doctor.LOOK_S", 0.2)
    client = daemon.client()
    sensor = Sensor(daemon, "hurt").begin().perform("left")
    client.events("gesture", "hurt")
    sensor.sock.send(floats("/hurt/matrix", Hand().frame(), 0))
    sensor.sock.send(encoding.message("/hurt/pressure", "f" * 25, [0.0] * 25))
    while not {"address", "size"} <= set(daemon.ask("status")["input"]["dropped"]):
        pass
    status, out, err = ctl("doctor", "--json")
    findings = [json.loads(line) for line in out.splitlines()]
    assert err == "" and status == (1 if any(f["level"] == "bad" for f in findings) else 0)
    drops = ((re.search(r"since the start: (\w+)", f["what"]), f["remedy"]) for f in findings)
    dropped = {found[1]: remedy for found, remedy in drops if found}
    assert "[addresses]" in dropped["address"] and "grid" in dropped["size"]
    assert any(f["level"] == "ok" and "passes its self-test" in f["what"] for f in findings)
    assert all(f["remedy"] for f in findings if f["level"] != "ok" and "limit" not in f["what"])


def test_doctor_says_why_a_fallback_cannot_stand_in(run, serve, tmp_path: Path) -> None:
    other = tiny_model.make(tmp_path / "other.onnx", gestures=tiny_model.GESTURES[::-1])
    missing = f"{tmp_path}/none.onnx: cannot be opened: No such file or directory\n"
    control = serve("--fallback", other, "--fallback", tmp_path / "none.onnx").ready["control"]
    said = run("doctor", "--control", control)[1]
    assert "warn    other: cannot stand in for tiny, expected the same gestures in the same order (one_tap" in said
    assert f"warn    {missing}" in said
    control = serve("--fallback", tmp_path / "none.onnx").ready["control"]
    assert run("reload", "--control", control)[1] == f"reloaded; tiny answers\na fallback cannot be used: {missing}"


def test_doctor_without_any_daemon_asks_whether_it_runs(run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(address, "UNIX_SOCKETS", tmp_path / "table")  # else what is said depends on this machine
    status, out, _ = run("doctor", "--control", tmp_path / "none.ctl")
    assert status == 1 and "no daemon on" in out and "does it run? systemctl status gestured" in out


def test_doctor_finds_a_daemon_whose_sockets_were_removed(run, serve) -> None:
    control = Path(serve().ready["control"])  # as a session that ends removes its folder, and a cleaner what is old
    control.unlink()
    findings = map(json.loads, run("doctor", "--control", control, "--json")[1].splitlines())
    (found,) = [found for found in findings if str(control) in found["what"]]
    assert found["level"] == "bad" and "start it again" in found["remedy"] and str(control.parent) in found["remedy"]


def test_doctor_names_a_daemon_that_runs_with_another_socket(ctl, run, daemon: Daemon, tmp_path: Path) -> None:
    status, out, _ = run("doctor", "--control", tmp_path / "none.ctl", "--json")
    said = [found for found in map(json.loads, out.splitlines()) if found["level"] != "ok"]
    assert status == 1 and str(daemon.socket) in said[-1]["what"] and "GESTURED_SOCKET=" in said[-1]["remedy"]
    assert not any("start gestured" in found["what"] or "in use" in found["what"] for found in said)


def test_a_reload_after_a_change_of_the_socket_says_that_it_needs_a_restart(run, daemon: Daemon, monkeypatch) -> None:
    monkeypatch.setenv("GESTURED_SOCKET", str(daemon.socket.with_name("other.sock")))  # as systemd's reload reads it
    status, _, err = run("reload")
    assert status == 1 and err.count("\n") == 1 and str(daemon.socket) in err and "restart it" in err


def test_doctor_says_first_what_to_set_where_everything_is_dropped(run, serve, monkeypatch) -> None:
    monkeypatch.setattr("gestured.control.doctor.LOOK_S", 0.2)
    daemon = serve()
    with sending([floats("/arm/pressure", np.zeros((12, 8)), 0)], daemon.address):
        while "size" not in daemon.ask("status")["input"]["dropped"]:
            pass
        out = run("doctor", "--control", daemon.ready["control"], "--json")[1]
    cause, *rest = [found for found in map(json.loads, out.splitlines()) if found["level"] == "bad"]
    assert "does not fit the settings" in cause["what"]
    assert cause["remedy"].splitlines()[1] == "[sensors.arm]" and re.search(r'grid = "(12x8|8x12)"', cause["remedy"])
    assert [found["what"] for found in rest] == ["no sensor was heard, since all that arrives is dropped"]
    assert "ROWSxCOLUMNS" not in out


def test_a_socket_that_is_not_for_us_names_the_remedy(run, monkeypatch: pytest.MonkeyPatch) -> None:
    def connect(self: socket.socket, path: str) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(socket.socket, "connect", connect)
    for command in ("status", "listen --reconnect", "doctor"):  # to call again would change nothing
        status, out, err = run(*command.split())
        assert status == 1 and "Permission denied: it is for members of its group" in out + err
        assert 'usermod -aG gestured,gestured-events "$USER"' in out + err


def test_doctor_calls_no_model_bad_that_runs_and_that_only_the_daemon_may_read(monkeypatch: pytest.MonkeyPatch) -> None:
    def opened(path: Path) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("gestured.model.file.open_regular", opened)
    found = model_finding("/etc/gestured/mine.onnx", "0" * 64)
    assert (found.level, found.remedy) == ("warn", "ask as root, or as the daemon's account")
    assert model_finding("/etc/gestured/mine.onnx", None).level == "bad"


def test_doctor_looks_at_the_machine(tmp_path: Path) -> None:
    limit = tmp_path / "rmem_max"
    limit.write_text("212992\n")
    small = _buffer(limit)
    limit.write_text(f"{BUFFER_BYTES}\n")
    assert (small.level, _buffer(limit).level) == ("warn", "ok") and "sysctl" in small.remedy
    assert (_clock(0.0).level, _clock(1.8e9).level) == ("bad", "ok")
    for mode, level in ((0o660, "ok"), (0o666, "warn")):
        limit.chmod(mode)
        assert _permissions(limit).level == level
    gone = _permissions(tmp_path / "gone.ctl")  # since it answered
    assert gone.level == "bad" and "gone.ctl: No such file" in gone.what and gone.remedy
    with socket.socket(type=socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        found = _port(Address(*taken.getsockname()))
    assert found.level == "warn" and "in use" in found.what and "--listen" in found.remedy
