"""The demo at a terminal: the finger as it moves."""

import os
import pty
import re
import select
import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest

from tests.daemon.harness import DEADLINE_S

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


@pytest.mark.e2e
def test_the_demo_begins_with_a_circle_that_is_drawn_and_ends_with_what_comes_next(terminal, shallow) -> None:
    demo = terminal("demo", "--seconds", 8, "--speed", "normal", TMPDIR=str(shallow))
    said = demo.until("performed   circle_clockwise")
    assert re.search(r"http://127\.0\.0\.1:\d+/#", said)
    seen = {sign for sign in said if sign in ARROWS}
    assert len(seen) >= 5  # it goes round
    drawn = [picture for picture in pictures(said) if picture and picture[0].startswith("demo  ")]
    assert drawn and all(len(picture) <= 23 and max(map(len, picture)) <= 79 for picture in drawn[:-1])
    end = demo.until("gesturectl simulate")
    assert "gestured --" in end and "percentile" not in end and re.search(r"gestures +[1-9]: ", end)
    assert demo.process.wait(DEADLINE_S) == 0
