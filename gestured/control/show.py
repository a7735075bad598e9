"""The output of the demo: a block for each gesture, the summary, and below them the sensor, redrawn in place."""

import os
import sys
from collections.abc import Mapping
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.client.picture import draw, shrunk
from gestured.client.say import say_drawn, shown
from gestured.record.judge import NONE, Outcome, Performed

VERDICT_COLOURS = {"right": 32, "rejected": 32, "wrong": 31, "false": 31, "missed": 33}
BOLD, DIM = 1, 2
UP, CLEAR_BELOW = "\x1b[{}F", "\x1b[J"
HIDE, SHOW = "\x1b[?25l", "\x1b[?25h"  # the cursor
STOPWATCH_S = 1e6  # smaller times are seconds on a stopwatch, not since 1970
NOISE = 20.0  # times the sensor's noise: the least counts that are drawn brightest, so that noise stays dark


def paint(text: str, code: int, colour: bool) -> str:
    """The text in an ANSI style, or unchanged without `colour`."""
    return f"\x1b[{code}m{text}\x1b[0m" if colour else text


def name(performed: Performed | None) -> str:
    """The name of a performance, for a person."""
    if performed is None:
        return "nothing"
    return f"no gesture ({performed.kind.replace('_', ' ')})" if performed.label == NONE else performed.label


def clock(t: float) -> str:
    """A time for a person: the time of day of a date, else seconds on a stopwatch."""
    return datetime.fromtimestamp(t).strftime("%H:%M:%S.%f")[:-3] if t >= STOPWATCH_S else f"{t:.3f} s"


def said_when(decided: float, offset: float) -> str:
    """The time between `decided` and `offset`, the last touched frame (both in s), in words."""
    ms = round(1000 * (offset - decided))
    return f"{abs(ms)} ms {'before' if ms >= 0 else 'after'} the finger left"


def block(outcome: Outcome, picture: NDArray[np.float32], colour: bool) -> str:
    """Picture and words of one outcome: six lines, of which the last is empty."""
    event, performed = outcome.event, outcome.performed
    if event:
        by = f"  by {event['model']}, degraded" if event["degraded"] else ""
        answer = shown(f"{event['gesture']}  {event['confidence']:.2f}{by}")
    else:
        answer = "unknown" if performed and performed.unknown else "-"
    when = f"{1000 * outcome.latency_s:.0f} ms after its end" if outcome.latency_s is not None else ""
    verdict = paint(outcome.verdict.upper(), VERDICT_COLOURS[outcome.verdict], colour)
    early = outcome.early
    said = shown(f"{early['gesture']}, {said_when(early['decided'], event['offset'])}") if early and event else ""
    words = [
        f"performed   {name(performed)}",
        *([f"said early  {said}"] if said else []),
        f"recognised  {paint(answer, BOLD, colour)}",
        f"            {verdict}  {paint(when, DIM, colour)}".rstrip(),
        "",
    ]
    words = words if said else ["", *words]
    lines = [f"  {row}   {text}".rstrip() for row, text in zip(draw(picture, colour), words, strict=True)]
    return "\n".join([*lines, ""])


def as_dict(outcome: Outcome) -> dict[str, Any]:
    """One outcome as plain JSON values."""
    performed, event = outcome.performed, outcome.event
    return {
        "type": "outcome",
        "verdict": outcome.verdict,
        "performed": performed.label if performed else None,
        "kind": performed.kind if performed else None,
        "recognised": event["gesture"] if event else "unknown" if performed and performed.unknown else None,
        "confidence": event["confidence"] if event else None,
        "provisional": outcome.early["gesture"] if outcome.early else None,
        "lead_ms": round(1000 * (event["offset"] - outcome.early["decided"])) if event and outcome.early else None,
        "latency_ms": None if outcome.latency_s is None else round(1000 * outcome.latency_s, 1),
    }


def in_words(figures: Mapping[str, Any], colour: bool) -> str:
    """The tally in words."""
    gestures = figures["right"] + figures["wrong"] + figures["missed"]
    others = figures["rejected"] + figures["false"]
    lines = [
        paint("Summary", BOLD, colour),
        f"  gestures       {gestures:3d}:  "
        f"{figures['right']} right, {figures['wrong']} wrong, {figures['missed']} missed",
        f"  anything else  {others:3d}:  {figures['rejected']} rejected, {figures['false']} false events",
    ]
    if figures["latency_ms_median"] is not None:  # of twenty gestures or more
        lines.append(
            f"  latency (end of the gesture to the event):  median {figures['latency_ms_median']} ms, "
            f"95th percentile {figures['latency_ms_p95']} ms"
        )
    if figures["provisional"]:
        lead = figures["lead_ms_median"]
        when = "" if lead is None else f":  median {said_when(0.0, lead / 1000)}"
        lines.append(f"  said early     {figures['provisional']:3d}:  {figures['confirmed']} confirmed{when}")
    return "\n".join(lines)


def in_colour() -> bool:
    """Whether the output is a terminal that shows colours, and the user wants them (NO_COLOR is not set)."""
    plain = "NO_COLOR" in os.environ or os.environ.get("TERM") == "dumb"
    return sys.stdout.isatty() and not plain


class Screen:
    """The lines at the bottom of a terminal that are redrawn in place; a context manager that hides the cursor."""

    def __init__(self) -> None:
        self._lines: list[str] = []

    def draw(self, lines: list[str]) -> None:
        """Put these lines in the place of the last ones."""
        if lines == self._lines:
            return
        say_drawn(self._back() + "\n".join(lines))
        self._lines = lines

    def above(self, text: str) -> None:
        """Print a text that stays, above the redrawn lines."""
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
    """One sensor in lines for a terminal, from the daemon's views of it."""

    def __init__(self, colour: bool) -> None:
        self._colour = colour
        self._full = 0.0  # counts that are drawn brightest: the most so far

    def lines(self, view: dict[str, Any]) -> list[str]:
        """A view as a picture with words beside it."""
        head = shown(f"{view['sensor']}  {view['state']}")
        if view["values"] is None:
            return [head, "the idle sensor is being learned:", "leave it untouched for a second"]
        values = np.array(view["values"], np.float32).reshape(view["grid"])
        self._full = max(self._full, float(values.max()), NOISE * view["noise"])
        words = ["", head, f"phase     {view['phase'].lower()}", f"activity  {view['activity']:.1f}", ""]
        picture = draw(shrunk(np.clip(values / self._full, 0.0, 1.0)), self._colour)
        return [f"  {row}   {text}".rstrip() for row, text in zip(picture, words, strict=True)]
