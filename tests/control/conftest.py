"""gesturectl as a process, and a real daemon for it."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from socketserver import StreamRequestHandler, ThreadingUnixStreamServer
from tempfile import TemporaryFile
from threading import Thread
from typing import Any

import pytest

from gestured.control.cli import main
from tests.control.browser import PROGRAM, Browser
from tests.control.pages import Page, viewing
from tests.daemon import tiny_model
from tests.daemon.harness import DEADLINE_S, Daemon, Sensor, running
from tests.sockets import FakeDaemon, meanwhile

ROOT = Path(__file__).resolve().parents[2]
NUMBERS = count()
SLOW = ("--stale-s", 30)  # no sensor falls silent soon
LONG = "n" * 64  # the longest name that a sensor may have
Start = Callable[..., "subprocess.Popen[bytes]"]


@pytest.fixture
def shallow() -> Iterator[Path]:
    """A folder for temporary files that is not deep: the path of a socket has at most 107 bytes."""
    with tempfile.TemporaryDirectory(prefix="gestured-", dir="/tmp") as name:
        yield Path(name)


@pytest.fixture(scope="session", autouse=True)
def _hangup() -> None:
    """Programs that are started here take SIGHUP as usual, also where `nohup` started the tests.

    A program inherits that a signal is ignored, but not that it is handled.
    """
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: None)


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts gesturectl with these arguments; whatever still runs at the end of the test is ended."""
    running: list[subprocess.Popen[bytes]] = []

    def begin(*arguments: object, **more: Any) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", "gestured.control", *map(str, arguments)]
        options: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "stdin": subprocess.DEVNULL}
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
        handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
        with TemporaryFile("w+") as out, TemporaryFile("w+") as err, monkeypatch.context() as patch:
            patch.setattr(os, "nice", lambda more: more)  # it would hold for this process, and all tests that follow
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

        with meanwhile(daemon):
            return run(*arguments)

    return finish


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon with a small model and a flight recorder."""
    folder = tmp_path_factory.mktemp("daemon")
    with running(folder, tiny_model.make(folder / "tiny.onnx"), *SLOW, "--flight-recorder", 4) as daemon:
        yield daemon


@pytest.fixture
def ctl(run: Callable[..., tuple[int, str, str]], daemon: Daemon) -> Callable[..., tuple[int, str, str]]:
    """Runs gesturectl against that daemon."""
    return lambda *arguments: run(*arguments, "--control", daemon.ready["control"])


@pytest.fixture(scope="session")
def real(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon to look at, with provisional events, fingers, a flight recorder and two sensors with zones."""
    folder = tmp_path_factory.mktemp("real")
    model = tiny_model.make(folder / "tiny.onnx", provisional=tiny_model.PROVISIONAL)
    config = folder / "gestured.toml"
    zones = f"[sensors.zoned.zones.left]\nat = [0, 0, 0.5, 1]\n[sensors.{LONG}.zones.{'z' * 64}]\nat = [0, 0, 1, 1]\n"
    config.write_text(f"touch = true\nflight_recorder = 4\n{zones}")
    with running(folder, model, *SLOW, "--config", config) as daemon:
        yield daemon


@pytest.fixture
def arm() -> str:
    """A sensor that no other test has."""
    return f"arm{next(NUMBERS)}"


@pytest.fixture
def view(real: Daemon, tmp_path: Path) -> Iterator[Page]:
    """The page of `gesturectl view` of that daemon."""
    with viewing(real.ready["control"], tmp_path) as page:
        yield page


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A browser for all tests."""
    if PROGRAM is None:
        pytest.skip("chromium is not installed (apt install chromium)")
    with Browser(tmp_path_factory.mktemp("chromium")) as browser:
        yield browser


@pytest.fixture
def browser(chromium: Browser) -> Iterator[Browser]:
    """A browser that shows nothing yet."""
    yield chromium
    chromium.call("Page.navigate", url="about:blank")
    chromium.call("Emulation.setTouchEmulationEnabled", enabled=False)
    chromium.said.clear()


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
    """Performs them, and waits until the daemon has read all packets, and has said what it makes of them."""

    def perform() -> None:
        client = daemon.client().subscribe("release", sensors=[name])
        with daemon.control() as tap:
            tap.ask("tap")
            sensor = Sensor(daemon, name).begin().perform(*directions)
            client.events("release", name, len(directions))
            packets = (line for line in tap.lines() if line["type"] == "packet")
            for _ in range(sensor.count):
                next(packets)

    return perform


@pytest.fixture
def fake_control(tmp_path: Path) -> Iterator[Callable[..., Path]]:
    """A daemon whose version, model and only sensor have this name, which may be one that no real one has."""
    with ExitStack() as held:

        def begin(name: str, **wrong: object) -> Path:
            sensor = {"state": name, "rate_hz": 15.0, "jitter_s": 0.0, "lost": 0, "bad_taxels": 0, "source": "a:1"}
            status = {
                "type": "state", "version": name, "state": "ok", "sensors": {name: sensor},
                "model": {"active": name, "gestures": [name]}, "flight_recorder": {"limit_bytes": 0},
                "input": {"dropped": {}, "kernel_drops": 0},
            } | wrong  # fmt: skip

            class Answers(StreamRequestHandler):
                def handle(self) -> None:
                    for line in self.rfile:
                        follows = json.loads(line)["verb"] == "follow"
                        for told in [{"ok": True}, status] if follows else [{"ok": False, "reason": name}]:
                            self.wfile.write(json.dumps(told).encode() + b"\n")

            server = held.enter_context(ThreadingUnixStreamServer(str(tmp_path / "fake.ctl"), Answers))
            server.daemon_threads = True
            Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()  # s, until it hears `shutdown`
            held.callback(server.shutdown)
            return tmp_path / "fake.ctl"

        yield begin
