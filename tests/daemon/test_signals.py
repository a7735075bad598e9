"""SIGTERM, SIGINT, SIGHUP; and what systemd is told."""

import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.daemon import tiny_model
from tests.daemon.harness import DEADLINE_S, Daemon, Sensor, lines_of


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_end_answers_what_is_in_flight(start, number: int) -> None:
    daemon = start("--clock", "sensor")
    client = daemon.client().subscribe("gesture", "onset", "cancelled", "release")
    sensor = Sensor(daemon, "arm").begin()
    sensor.send(sensor.hand.tap(), sensor.hand.idle(0.2))  # a second tap may still come
    assert client.line()["type"] == "onset"
    daemon.signal(number)
    assert [client.line()["type"] for _ in range(2)] == ["gesture", "release"]
    assert daemon.wait() == 0
    assert client.sock.recv(1) == b""
    assert not daemon.socket.exists() and not daemon.socket.with_name("events.sock.lock").exists()
    assert "Traceback" not in daemon.stderr()


def reload(daemon: Daemon, result: str) -> None:
    """Send SIGHUP and wait until it is over."""
    before = daemon.metric("gestured_reloads_total", result=result)
    client = daemon.client().subscribe("status")
    daemon.signal(signal.SIGHUP)
    while daemon.metric("gestured_reloads_total", result=result) == before:
        client.line()


def test_reload_takes_a_new_model_and_configuration_and_keeps_what_was_learned(start, model, tmp_path) -> None:
    path = tmp_path / "mine.onnx"
    path.write_bytes(model.read_bytes())
    config = tmp_path / "gestured.toml"
    config.write_text("")
    flags = ("--config", config, "--clock", "sensor", "--metrics", "127.0.0.1:0", "--stale-s", 30)
    daemon = start(*flags, model=path)
    client = daemon.client().subscribe("gesture", "unknown")
    sensor = Sensor(daemon, "arm").begin().perform("left")
    assert client.line()["gesture"] == "swipe_left"
    tiny_model.make(path, gestures=("knock", *tiny_model.GESTURES[1:]))
    config.write_text("[gestures.swipe_left]\nthreshold = 1.0\n")
    reload(daemon, "done")
    sensor.send(sensor.hand.idle(0.2))  # it may have been silent for long: a model is tried
    sensor.perform("left", "tap")  # without two quiet seconds: the baseline is still known
    told, *lines = [client.line() for _ in range(3)]
    assert told == {"type": "gestures", "gestures": ["knock", *tiny_model.GESTURES[1:]]}
    assert [(e["type"], e.get("gesture"), e["id"]) for e in lines] == [("unknown", None, 2), ("gesture", "knock", 3)]
    assert lines[1]["sequence"] == 2
    assert daemon.client().hello["gestures"][0] == "knock"
    assert daemon.client().hello["instance"] == client.hello["instance"]


def test_reload_with_other_gestures_changes_what_is_waited_for(start, tmp_path: Path) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text("")
    daemon = start("--config", config, "--clock", "sensor", "--metrics", "127.0.0.1:0")
    client = daemon.client()
    config.write_text('gestures = ["one_tap", "swipe_left"]\n')
    sensor = Sensor(daemon, "arm").begin().perform("tap")
    slow = client.line()
    reload(daemon, "done")
    sensor.begin().perform("tap")
    told, quick = client.line(), client.line()
    assert told == {"type": "gestures", "gestures": ["one_tap", "swipe_left"]}
    assert (slow["gesture"], quick["gesture"], quick["sequence"]) == ("one_tap", "one_tap", 2)
    assert slow["decided"] - slow["offset"] > 0.5 > 0.25 > quick["decided"] - quick["offset"]
    assert set(quick["scores"]) == {"one_tap", "swipe_left"} == set(daemon.client().hello["gestures"])


def test_reload_of_something_invalid_changes_nothing(start, model: Path, tmp_path: Path) -> None:
    path, spare = tmp_path / "mine.onnx", tmp_path / "spare.onnx"
    path.write_bytes(model.read_bytes())
    spare.write_bytes(model.read_bytes())
    config = tmp_path / "gestured.toml"
    config.write_text("")
    flags = ("--config", config, "--clock", "sensor", "--metrics", "127.0.0.1:0", "--stale-s", 30)
    daemon = start(*flags, "--fallback", spare, model=path)
    client = daemon.client()
    sensor = Sensor(daemon, "arm").begin()
    stricter = "[gestures.swipe_left]\nthreshold = 1.0\n"
    config.write_text(stricter + "nonsense = 1\n")
    reload(daemon, "refused")
    config.write_text(stricter)
    path.write_bytes(model.read_bytes()[:3000])  # the fallback would do at a start, but a good model runs
    reload(daemon, "refused")
    path.write_bytes(model.read_bytes())
    tiny_model.make(spare, gestures=tiny_model.GESTURES[::-1])  # at a start the model would answer without it
    reload(daemon, "refused")
    sensor.send(sensor.hand.idle(0.2))  # it may have been silent for long: a model is tried
    sensor.perform("left")
    (event,) = client.events("gesture", "arm")
    assert (event["gesture"], event["model"]) == ("swipe_left", "mine")
    said = [line["reason"] for line in lines_of(daemon.stderr()) if "refused" in line["event"]]
    assert len(said) == 3 and "nonsense" in said[0] and said[1].startswith(f"{path}: ")  # no model is put aside
    assert said[2].startswith("spare: cannot stand in for mine, ")


def test_systemd_is_told(start, tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as supervisor:
        supervisor.bind(str(tmp_path / "notify"))
        supervisor.settimeout(DEADLINE_S)

        def until(word: str) -> str:
            while word not in (said := supervisor.recv(4096).decode()):
                pass
            return said

        daemon = start(env={"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "300000"})
        assert supervisor.recv(4096).decode().startswith("READY=1\nSTATUS=")
        assert until("STATUS=no_data") == "STATUS=no_data: tiny answers; sensors: none yet"
        until("WATCHDOG=1")
        until("WATCHDOG=1")
        sensor = Sensor(daemon, "arm")
        while "STATUS=ok: tiny answers; sensors: arm " not in supervisor.recv(4096).decode():
            sensor.send(sensor.hand.idle(0.2))  # it must not fall silent before the second is over
        daemon.signal(signal.SIGHUP)
        assert "MONOTONIC_USEC=" in until("RELOADING=1")
        until("READY=1")
        daemon.signal(signal.SIGTERM)
        until("STOPPING=1")
        assert daemon.wait() == 0


def test_signals_that_its_starter_had_blocked_reach_it(start) -> None:
    """A child has the mask of the thread that starts it, which some supervisors forget."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGHUP})
    try:
        daemon = start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    daemon.signal(signal.SIGHUP)
    while not daemon.ask("status")["reloads"]:
        pass
    assert daemon.stop() == 0


@pytest.mark.parametrize("number", [signal.SIGUSR1, signal.SIGUSR2])
def test_a_signal_that_asks_other_daemons_for_something_ends_nothing(start, number: int) -> None:
    daemon = start()
    daemon.signal(number)
    assert daemon.ask("status")["ready"]["ready"]


def test_a_stop_before_it_is_ready_is_no_failure(model: Path, tmp_path: Path) -> None:
    daemon = Daemon(tmp_path, "--model", model, "--listen", "127.0.0.1:0", "--socket", tmp_path / "s", python=["-v"])
    with daemon.stderr_path.open() as log:
        while "import 'onnxruntime" not in log.read():
            assert daemon.process.poll() is None
    assert daemon.stop() == 0
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_stop_while_it_imports_its_settings_is_no_failure(number: int) -> None:
    """A library that is being imported may turn an exception of a signal's handler into an error of its own."""
    script = f"""if True:
        import signal, sys
        from gestured.daemon.cli import main
        class Library:
            def find_spec(self, name, *_):
                if name == "pydantic":
                    try:
                        signal.raise_signal({int(number)})
                    except BaseException as error:
                        raise ImportError("of its own") from error
        sys.meta_path.insert(0, Library())
        sys.exit(main(["--explain"]))
    """
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
