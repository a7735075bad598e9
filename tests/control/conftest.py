"""gesturectl as a process, and a scripted stand-in for the daemon's event socket."""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.daemon import tiny_model
from tests.daemon.harness import Daemon, Sensor

ROOT = Path(__file__).resolve().parents[2]
HELLO = {
    "type": "hello",
    "protocol": 1,
    "version": "0.0",
    "instance": "a",
    "model": "cnn_lstm",
    "gestures": ["one_tap"],
    "sensors": {"armrest": 3},
}
Start = Callable[..., "subprocess.Popen[bytes]"]


@pytest.fixture
def shallow() -> Iterator[Path]:
    """A folder for temporary files that is not deep: the path of a socket has at most 107 bytes."""
    with tempfile.TemporaryDirectory(prefix="gestured-", dir="/tmp") as name:
        yield Path(name)


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts gesturectl with these arguments; whatever still runs at the end of the test is ended."""
    running: list[subprocess.Popen[bytes]] = []

    def begin(*arguments: object, **more: Any) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", "gestured.control", *map(str, arguments)]
        options: dict[str, Any] = {
            "stdout": subprocess.PIPE,
            "stderr": subprocess.PIPE,
            "stdin": subprocess.DEVNULL,
        }
        more["env"] = os.environ | {"PYTHONUNBUFFERED": "1"} | more.get("env", {})
        process = subprocess.Popen(command, **options | more)
        running.append(process)
        return process

    yield begin
    for process in running:
        process.kill()
        process.communicate()


@pytest.fixture
def run(start: Start) -> Callable[..., tuple[int, str, str]]:
    """Runs gesturectl to its end: exit status, standard output, standard error."""

    def finish(*arguments: object, **more: Any) -> tuple[int, str, str]:
        process = start(*arguments, **more)
        out, err = process.communicate(timeout=60)
        return process.returncode, out.decode(), err.decode()

    return finish


class FakeDaemon:
    """An event socket that says exactly what the test tells it to."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listener.bind(str(path))
        self.listener.listen()
        self.listener.settimeout(30)
        self.client: socket.socket

    def accept(self, hello: object = HELLO) -> None:
        self.client, _ = self.listener.accept()
        self.client.settimeout(30)
        self.say(hello)

    def say(self, *messages: object) -> None:
        for message in messages:
            self.client.sendall(message if isinstance(message, bytes) else json.dumps(message).encode() + b"\n")

    def request(self) -> Any:
        return json.loads(self.client.makefile("rb").readline())

    def close(self) -> None:
        self.client.close()


@pytest.fixture
def fake(tmp_path: Path) -> Iterator[FakeDaemon]:
    daemon = FakeDaemon(tmp_path / "events.sock")
    yield daemon
    daemon.listener.close()


@pytest.fixture
def udp() -> Iterator[socket.socket]:
    """A UDP socket on the loopback that keeps what is sent to it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(30)
        yield receiver


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A real daemon with a small model, the sensor's clock and a flight recorder; no sensor falls silent soon."""
    pytest.importorskip("onnx", reason="the tests' own model is made with the onnx package")
    folder = tmp_path_factory.mktemp("daemon")
    model = tiny_model.make(folder / "tiny.onnx")
    daemon = Daemon.start(folder, model, "--clock", "sensor", "--flight-recorder", 4, "--stale-s", 30)
    yield daemon
    assert daemon.stop() == 0, daemon.stderr()
    assert "Traceback" not in daemon.stderr()


@pytest.fixture
def ctl(run: Callable[..., tuple[int, str, str]], daemon: Daemon) -> Callable[..., tuple[int, str, str]]:
    """Runs gesturectl against that daemon."""
    return lambda *arguments: run(*arguments, "--control", daemon.ready["control"])


@pytest.fixture
def recorded(start, daemon: Daemon, tmp_path: Path):
    """Records what the function does to the daemon, to the end of the file."""

    def record(perform, name: str = "a.mcap", stop: int = signal.SIGINT) -> tuple[Path, bytes]:
        path = tmp_path / name
        recorder = start("record", path, "--control", daemon.ready["control"], "--json")
        assert b"recording into" in recorder.stderr.readline()
        perform()
        recorder.send_signal(stop)
        return path, recorder.communicate(timeout=30)[0]

    return record


def gestures(daemon: Daemon, name: str, *directions: str):
    """Performs them, and waits for what the daemon makes of them."""

    def perform() -> None:
        client = daemon.client().subscribe("release", sensors=[name])
        Sensor(daemon, name).begin().perform(*directions)
        client.events("release", name, len(directions))

    return perform
