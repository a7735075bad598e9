"""Collecting on a pad: its page shows what the terminal says, and its keys are the terminal's."""

import queue
import re
from contextlib import suppress

from gestured.client.pad.invitation import invite
from gestured.client.pad.server import PadServer
from gestured.client.say import say
from gestured.lab.recordings.terminal import Terminal

RATE_HZ = 15.0  # the models' own
KIND = "touchscreen"  # of sensor, in recordings
NON_GESTURES = ("diagonal_swipe", "check_mark", "zigzag", "scribble", "spiral", "back_and_forth", "pinch", "rubbing")
KEYS = ("\n", "r", "d", "y", "p")  # that the page may press; quitting is the terminal's
COLOUR = re.compile(r"\x1b\[[0-9;]*m")


class PadTerminal(Terminal):
    """A terminal, and the page of a pad."""

    def __init__(self) -> None:
        super().__init__()
        self._pressed: queue.SimpleQueue[str] = queue.SimpleQueue()

    def join(self, server: PadServer) -> None:
        """The page of `server` belongs to it from now on; its address is printed."""
        self._server = server
        server.press = self._press
        say(server.page)
        invite(server)

    def key(self) -> str | None:
        """A key that was pressed here or there."""
        with suppress(queue.Empty):
            return self._pressed.get_nowait()
        return super().key()

    def say(self, text: str, end: str = "\n") -> None:
        """Print, here and there."""
        super().say(text, end)
        self._server.say(COLOUR.sub("", text) + end)

    def _press(self, key: str) -> None:
        if key in KEYS:
            self._pressed.put(key)
