"""The finger as it moves, at a terminal: gesturectl watch, and the demo."""

import os
import pty
import re
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gestured.client.control import Control
from tests.daemon.harness import DEADLINE_S, Daemon, Sensor

ARROWS = set("→↘↓↙←↖↑↗")


class Terminal:
    """A program at a terminal of 80 x 24."""

    def __init__(self, *arguments: object, **more: str) -> None:
        self._ours, theirs = pty.openpty()
        command = [sys.executable, "-m", "gestured.control", *map(str, arguments)]
        environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"} | more
        self.process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment)
        os.close(theirs)
        self.said = ""

    def until(self, expected: str) -> str:
        """What it says until that stands there; in the end, where nothing is expected."""
        while expected not in self.said or not expected:
            readable, _, _ = select.select([self._ours], [], [], DEADLINE_S)
            assert readable, f"expected {expected!r}, found {self.said[-2000:]!r}"
            try:
                self.said += os.read(self._ours, 65536).decode(errors="replace")
            except OSError:  # it has ended
                break
        assert expected in self.said
        return self.said

    def close(self) -> None:
        """End it."""
        self.process.kill()
        self.process.wait()
        os.close(self._ours)


@pytest.fixture
def terminal() -> Iterator[Callable[..., Terminal]]:
    open_: list[Terminal] = []

    def begin(*arguments: object, **more: str) -> Terminal:
        open_.append(Terminal(*arguments, **more))
        return open_[-1]

    yield begin
    for one in open_:
        one.close()


def pictures(said: str) -> list[list[str]]:
    """What stood there one after the other, without colours."""
    parts = re.split("\x1b\\[\\d*F\x1b\\[J|\x1b\\[J", said)
    return [re.sub("\x1b\\[[0-9;?]*[a-zA-Z]", "", part).splitlines() for part in parts]


def test_a_sensor_is_drawn_as_it_is_touched(terminal, daemon: Daemon) -> None:
    sensor = Sensor(daemon, "drawn").begin()
    client = daemon.client().subscribe("gesture", sensors=["drawn"])
    sensor.perform("left")
    client.events("gesture", "drawn")
    watch = terminal("watch", "drawn", "--control", daemon.ready["control"])
    watch.until("phase     idle")
    for frame in sensor.hand.swipe("right"):
        sensor.send([frame])
        watch.said = ""
        watch.until("phase     contact")
    watch.until("→")
    for picture in pictures(watch.said)[:-1]:
        assert len(picture) <= 23 and all(len(line) <= 79 for line in picture)
    sensor.send(sensor.hand.idle(1.0))
    watch.until("swipe_right  0.")
    watch.process.send_signal(signal.SIGINT)
    watch.until("\x1b[?25h")
    assert watch.process.wait(DEADLINE_S) == 0


def test_a_sensor_that_falls_silent_and_a_daemon_that_ends_are_told(terminal, serve) -> None:
    daemon = serve()
    Sensor(daemon, "drawn").begin()
    with Control(Path(daemon.ready["control"])) as control:
        while "drawn" not in control.ask("status")["sensors"]:
            pass
    watch = terminal("watch", "drawn", "--control", daemon.ready["control"])
    watch.until("drawn  stale")
    daemon.stop()
    watch.until("closed the connection")
    assert watch.process.wait(DEADLINE_S) == 1


def test_without_a_terminal_or_a_sensor_it_says_what_to_do(run, terminal, daemon: Daemon) -> None:
    status, out, err = run("watch", "drawn", "--control", daemon.ready["control"])
    assert (status, out) == (1, "") and "gesturectl listen" in err
    watch = terminal("watch", "nobody", "--control", daemon.ready["control"])
    assert "no sensor 'nobody'" in watch.until("expected one of")
    assert watch.process.wait(DEADLINE_S) == 1


@pytest.mark.e2e
def test_the_demo_begins_with_a_circle_that_is_drawn_and_ends_with_what_comes_next(terminal, shallow) -> None:
    demo = terminal("demo", "--seconds", 8, "--speed", "normal", TMPDIR=str(shallow))
    said = demo.until("performed   circle_clockwise")
    assert re.search(r"http://127\.0\.0\.1:\d+/#", said)
    seen = {sign for sign in said if sign in ARROWS}
    assert len(seen) >= 5  # it goes round
    end = demo.until("gesturectl simulate")
    assert "gestured --" in end and "percentile" not in end and re.search(r"gestures +[1-9]: ", end)
    assert demo.process.wait(DEADLINE_S) == 0
