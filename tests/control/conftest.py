"""gesturectl as a process, and a real daemon for it."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryFile
from threading import Thread
from typing import Any

import pytest

from gestured.client.control import Control
from gestured.control.cli import main
from tests.daemon import tiny_model
from tests.daemon.harness import DEADLINE_S, Daemon, Sensor
from tests.sockets import FakeDaemon, free_address

ROOT = Path(__file__).resolve().parents[2]
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
        process.terminate()  # what it has started itself, it ends itself
    for process in running:
        try:
            process.communicate(timeout=DEADLINE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, str, str]]:
    """Runs gesturectl to its end in this process: exit status, standard output, standard error."""

    def finish(*arguments: object, env: Mapping[str, str] = {}) -> tuple[int, str, str]:
        handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        with TemporaryFile("w+") as out, TemporaryFile("w+") as err, monkeypatch.context() as patch:
            patch.setattr(sys, "stdin", None)
            patch.setattr(sys, "stdout", out)
            patch.setattr(sys, "stderr", err)
            for name, value in env.items():
                patch.setenv(name, value)
            try:
                status = main([*map(str, arguments)])
            except SystemExit as ended:  # argparse
                status = ended.code if isinstance(ended.code, int) else 1
            finally:
                for number, handler in handlers.items():
                    signal.signal(number, handler)
            out.seek(0)
            err.seek(0)
            return status, out.read(), err.read()

    return finish


@pytest.fixture
def told(run: Callable[..., tuple[int, str, str]], fake: FakeDaemon) -> Callable[..., tuple[int, str, str]]:
    """Runs gesturectl, in this process, while `fake` takes one connection, says these lines and hangs up."""

    def finish(said: Sequence[object], *arguments: object) -> tuple[int, str, str]:
        def daemon() -> None:
            fake.accept(said[0])
            fake.say(*said[1:])
            fake.close()

        serving = Thread(target=daemon)
        serving.start()
        try:
            return run(*arguments)
        finally:
            serving.join()

    return finish


@pytest.fixture
def sniffed(start: Start) -> Callable[..., tuple[int, bytes, bytes]]:
    """What `gesturectl sniff` says, with these flags, of packets that are sent again and again while it listens."""

    def sniff(packets: list[bytes], *flags: object) -> tuple[int, bytes, bytes]:
        where = free_address()
        process = start("sniff", "--listen", where, "--seconds", 0.5, *flags)
        assert process.stderr is not None and b"listening" in process.stderr.readline()
        with socket.socket(type=socket.SOCK_DGRAM) as sender:
            while process.poll() is None:
                for packet in packets:
                    sender.sendto(packet, where)
        out, err = process.communicate(timeout=30)
        return process.returncode, out, err

    return sniff


def asked(daemon: Daemon) -> dict[str, Any]:
    """What a daemon answers to `status`."""
    with Control(Path(daemon.ready["control"])) as control:
        return control.ask("status")


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
