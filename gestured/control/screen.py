"""A part of the terminal that is drawn anew in place, with lines that scroll away above it; and one sensor in it."""

import os
import sys
from collections import deque
from typing import Any

import numpy as np

from gestured.client.picture import moving
from gestured.client.say import say_drawn, shown

UP, CLEAR_BELOW = "\x1b[{}F", "\x1b[J"
HIDE, SHOW = "\x1b[?25l", "\x1b[?25h"  # the cursor
STEPS = (1.0, 2.0, 5.0)  # of a scale, in each power of ten
NOISE = 20.0  # times the sensor's noise: the smallest scale, so that noise stays dark
BAR = 20  # characters
LOUD = 100.0  # noise units that fill the bar
PATH = 30  # places that are remembered


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
    """One sensor as it is felt, beside what is known of it: what the control verb `view` answers, in lines."""

    def __init__(self, colour: bool) -> None:
        self._colour = colour
        self._full = 0.0  # counts; the scale is fixed, and grows with what is seen
        self._path: deque[tuple[float, float]] = deque(maxlen=PATH)
        self._t: float | None = None

    def lines(self, view: dict[str, Any]) -> list[str]:
        """The picture with its words."""
        head = [shown(f"{view['sensor']}  {view['state']}"), ""]
        if view["values"] is None:
            return [*head, "the idle sensor is being learned: leave it untouched for a second"]
        values = np.array(view["values"]).reshape(view["grid"])
        self._full = max(self._full, _step(max(float(values.max()), NOISE * view["noise"])))
        if view["t"] != self._t:
            self._t = view["t"]
            if view["centroid"] is None:
                self._path.clear()
            else:
                self._path.append(tuple(view["centroid"]))
        loud = min(view["activity"] / LOUD, 1.0)
        words = [
            *head,
            f"phase     {view['phase'].lower()}",
            f"activity  {'█' * round(BAR * loud):<{BAR}} {view['activity']:5.1f}",
            f"          a contact from {view['on']:.1f} on, over below {view['off']:.1f}",
            f"scale     0 to {self._full:g} counts, {len(view['bad'])} bad taxels",
        ]
        picture = moving(values, list(self._path), self._full, self._colour)
        words += [""] * (len(picture) - len(words))
        return [f"{row}  {text}".rstrip() for row, text in zip(picture, words, strict=False)]


def _step(least: float) -> float:
    """The next of 1, 2, 5, 10, 20 ... that is not below `least`."""
    power = 10.0 ** np.floor(np.log10(max(least, 1e-9)))
    return float(next(step * power for step in (*STEPS, 10.0) if step * power >= least))
