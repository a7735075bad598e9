"""A part of the terminal that is drawn anew in place, with lines that scroll away above it; and one sensor in it."""

import os
import sys
from typing import Any

import numpy as np

from gestured.client.picture import draw, shrunk
from gestured.client.say import say_drawn, shown

UP, CLEAR_BELOW = "\x1b[{}F", "\x1b[J"
HIDE, SHOW = "\x1b[?25l", "\x1b[?25h"  # the cursor
NOISE = 20.0  # times the sensor's noise that are drawn brightest at least, so that noise stays dark


def in_colour() -> bool:
    """Whether the terminal shows colours, and its user wants them."""
    plain = "NO_COLOR" in os.environ or os.environ.get("TERM") == "dumb"
    return sys.stdout.isatty() and not plain


class Screen:
    """The lines below; a context manager, which gives the cursor back."""

    def __init__(self) -> None:
        self._lines: list[str] = []

    def draw(self, lines: list[str]) -> None:
        """Put these in the place of the last ones."""
        if lines == self._lines:
            return
        say_drawn(self._back() + "\n".join(lines))
        self._lines = lines

    def above(self, text: str) -> None:
        """Say something that stays, above them."""
        say_drawn(self._back() + text)
        lines, self._lines = self._lines, []
        if lines:
            self.draw(lines)

    def _back(self) -> str:
        return (UP.format(len(self._lines)) if self._lines else "") + CLEAR_BELOW

    def __enter__(self) -> "Screen":
        say_drawn(HIDE, end="")
        return self

    def __exit__(self, *_: object) -> None:
        say_drawn(SHOW, end="")


class Felt:
    """One sensor as it is felt: what the control verb `view` answers, in lines."""

    def __init__(self, colour: bool) -> None:
        self._colour = colour
        self._full = 0.0  # counts that are drawn brightest: the most that was seen

    def lines(self, view: dict[str, Any]) -> list[str]:
        """The picture with its words."""
        head = shown(f"{view['sensor']}  {view['state']}")
        if view["values"] is None:
            return [head, "the idle sensor is being learned: leave it untouched for a second"]
        values = np.array(view["values"], np.float32).reshape(view["grid"])
        self._full = max(self._full, float(values.max()), NOISE * view["noise"])
        words = ["", head, f"phase     {view['phase'].lower()}", f"activity  {view['activity']:.1f}", ""]
        picture = draw(shrunk(np.clip(values / self._full, 0.0, 1.0)), self._colour)
        return [f"  {row}   {text}".rstrip() for row, text in zip(picture, words, strict=True)]
