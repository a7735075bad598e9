"""A terminal that gives single keys and is restored at the end, and one that shows the same on a pad's page."""

import os
import queue
import re
import select
import signal
import sys
import termios
import tty
from contextlib import suppress
from types import FrameType

from gestured.client.pad.invitation import invite
from gestured.client.pad.server import PadServer
from gestured.client.say import say, say_drawn
from gestured.core.errors import GesturedError


class Ended(Exception):
    """The session ends: somebody quits, the terminal was closed, or the system asks to end."""


class Terminal:
    """Standard input and output as a context manager; raises GesturedError if they are no terminal.

    The terminal is restored however the block is left (a key, an error, Ctrl-C, SIGTERM, SIGHUP).
    """

    def __init__(self) -> None:
        if not (sys.stdin.isatty() and sys.stdout.isatty()):
            raise GesturedError("collect talks with a person: expected a terminal as standard input and output")
        self._fd = sys.stdin.fileno()

    def __enter__(self) -> "Terminal":
        self._before = termios.tcgetattr(self._fd)
        self._handlers = {number: signal.signal(number, self._end) for number in (signal.SIGTERM, signal.SIGHUP)}
        tty.setcbreak(self._fd)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        with suppress(termios.error):  # the terminal has gone
            termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)

    def fileno(self) -> int:
        """The file descriptor, to wait for a key with `select`."""
        return self._fd

    def key(self) -> str | None:
        r"""A key that was pressed, in lower case ("\n" for Enter), None if there is none.

        Raises Ended if there is no terminal any more.
        """
        if not select.select([self._fd], [], [], 0)[0]:
            return None
        try:
            typed = os.read(self._fd, 1)
        except OSError:
            typed = b""
        if typed in (b"", b"\x04"):  # gone, or Ctrl-D
            raise Ended
        return typed.decode("latin-1").lower()

    def line(self, prompt: str) -> str:
        """A line that a person types after `prompt`, and can correct while typing."""
        termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)
        try:
            return input(prompt)
        except EOFError:
            raise Ended from None
        finally:
            tty.setcbreak(self._fd)

    def say(self, text: str, end: str = "\n") -> None:
        """Print; text that somebody else chose must have gone through `shown`."""
        say_drawn(text, end)

    def _end(self, number: int, frame: FrameType | None) -> None:
        raise Ended


RATE_HZ = 15.0  # the models' own
KIND = "touchscreen"  # of sensor, in recordings
NON_GESTURES = ("diagonal_swipe", "check_mark", "zigzag", "scribble", "spiral", "back_and_forth", "pinch", "rubbing")
KEYS = ("\n", "r", "d", "y", "p")  # keys that the page may press; only the terminal can quit
COLOUR = re.compile(r"\x1b\[[0-9;]*m")


class PadTerminal(Terminal):
    """A terminal, and the page of a pad."""

    def __init__(self) -> None:
        super().__init__()
        self._pressed: queue.SimpleQueue[str] = queue.SimpleQueue()

    def join(self, server: PadServer) -> None:
        """Connect the page of `server`, and print its address."""
        self._server = server
        server.press = self._press
        say(server.page)
        invite(server)

    def key(self) -> str | None:
        """A key that was pressed at the terminal or on the page; None if there is none."""
        with suppress(queue.Empty):
            return self._pressed.get_nowait()
        return super().key()

    def say(self, text: str, end: str = "\n") -> None:
        """Print at the terminal and on the page."""
        super().say(text, end)
        self._server.say(COLOUR.sub("", text) + end)

    def _press(self, key: str) -> None:
        if key in KEYS:
            self._pressed.put(key)
