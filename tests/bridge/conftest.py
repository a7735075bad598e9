"""gestured-bridge as a process, and a real broker."""

import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from gestured.bridge.cli import main
from gestured.client.control import Control
from tests.daemon.harness import DEADLINE_S, Daemon, running
from tests.several import several
from tests.sockets import free_address


class Process:
    """A gestured-bridge; what it says goes into files."""

    def __init__(self, folder: Path, number: int, *arguments: object, env: dict[str, str] | None = None) -> None:
        self.errors = folder / f"bridge-{number}.txt"
        with self.errors.open("wb") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-X", "faulthandler", "-m", "gestured.bridge", *map(str, arguments)],
                stdout=subprocess.PIPE, stderr=errors, env=os.environ | (env or {}), text=True,
            )  # fmt: skip

    def ready(self) -> dict[str, Any]:
        """Its ready line, once it can work."""
        assert self.process.stdout is not None
        readable, _, _ = select.select([self.process.stdout], [], [], DEADLINE_S)
        line = self.process.stdout.readline() if readable else ""
        assert line, self.said()
        self.told: dict[str, Any] = json.loads(line)
        return self.told

    def said(self) -> str:
        """What it has said so far."""
        return self.errors.read_text()

    def until(self, words: str, count: int = 1) -> str:
        """What it has said, once these words are in it so many times."""
        return wait(lambda: self.said() if self.said().count(words) >= count else "", lambda: self.said())

    def end(self) -> int:
        """Its exit status, once it has ended by itself."""
        return self.process.wait(DEADLINE_S)

    def stop(self) -> int:
        """End it as an operator does."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.send_signal(signal.SIGTERM)
        try:
            return self.process.wait(DEADLINE_S)
        finally:
            self.process.kill()
            self.process.stdout.close()


def wait(look: Callable[[], Any], explain: Callable[[], object] = lambda: "it did not come") -> Any:
    """What a look finds, once it finds something."""
    end = time.monotonic() + DEADLINE_S
    while not (found := look()):
        assert time.monotonic() < end, explain()
        time.sleep(0.01)
    return found


def page(address: str) -> str:
    """What Prometheus is told."""
    with urllib.request.urlopen(f"http://{address}/metrics", timeout=DEADLINE_S) as answer:
        return answer.read().decode()


@pytest.fixture
def bridge(tmp_path: Path) -> Iterator[Callable[..., Process]]:
    """Starts bridges; whatever still runs at the end of the test is ended."""
    numbers = count()

    def ended(process: Process) -> None:
        process.stop()
        assert "Traceback" not in process.said()

    yield from several(lambda *flags, **more: Process(tmp_path, next(numbers), *flags, **more), ended)


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """What gestured-bridge says, in this process, of flags with which it cannot begin."""

    def refuse(*arguments: object) -> str:
        try:
            status = main([*map(str, arguments)])
        except SystemExit as ended:  # argparse
            status = ended.code if isinstance(ended.code, int) else 0
        assert status in (1, 2)
        return capsys.readouterr().err

    return refuse


def served(folder: Path, model: Path, *flags: object) -> Iterator[Daemon]:
    """For a fixture: a real daemon with the sensor's clock."""
    with running(folder, model, "--stale-s", 30, *flags) as daemon:
        yield daemon


@pytest.fixture(scope="module")
def daemon(model: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A real daemon with the sensor's clock."""
    yield from served(tmp_path_factory.mktemp("daemon"), model)


def emit(daemon: Daemon, gesture: str, sensor: str = "armrest") -> None:
    """A made-up event of a real daemon."""
    with Control(daemon.socket.with_suffix(".ctl")) as control:
        control.ask("emit", gesture=gesture, sensor=sensor)


def guarded(folder: Path, accounts: str, access: str) -> list[str]:
    """Lines of a broker's configuration that let in these accounts alone, each NAME:PASSWORD, to what `access` says."""
    if shutil.which("mosquitto_passwd") is None:
        pytest.skip("mosquitto is not installed (apt-get install mosquitto)")
    (folder / "passwords").write_text(accounts)
    subprocess.run(["mosquitto_passwd", "-U", str(folder / "passwords")], check=True, timeout=60)
    (folder / "access").write_text(access)
    for name in ("passwords", "access"):
        (folder / name).chmod(0o644)
    return ["allow_anonymous false", f"password_file {folder}/passwords", f"acl_file {folder}/access", "user root"]


class Broker:
    """Debian's mosquitto, on a port of the loopback."""

    def __init__(self, folder: Path, *lines: str) -> None:
        program = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin")
        if program is None:
            pytest.skip("mosquitto is not installed (apt-get install mosquitto)")
        self.port = free_address(socket.SOCK_STREAM).port
        self._log = folder / "mosquitto.txt"
        file = folder / "mosquitto.conf"
        file.write_text("\n".join([f"listener {self.port} 127.0.0.1", *(lines or ["allow_anonymous true"])]) + "\n")
        self._command = [program, "-c", str(file), "-v"]
        self.start()

    def start(self) -> None:
        """Run it, and wait until it listens."""
        with self._log.open("ab") as log:
            self.process = subprocess.Popen(self._command, stdout=log, stderr=log)
        wait(self._listens, lambda: self._log.read_text())

    def _listens(self) -> bool:
        assert self.process.poll() is None, self._log.read_text()
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    def said(self) -> str:
        """Its log: who connects, subscribes, publishes."""
        return self._log.read_text()

    def kill(self) -> None:
        """Without a word."""
        self.process.kill()
        self.process.wait()


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Callable[..., Broker]]:
    """Starts brokers with these lines of configuration."""
    yield from several(partial(Broker, tmp_path), Broker.kill)


@pytest.fixture
def site() -> Iterator[Any]:
    """A router of Zenoh, and a client of it that hears all: skipped without Zenoh."""
    from tests.bridge.zenoh_site import Site

    site = Site()
    yield site
    site.close()
