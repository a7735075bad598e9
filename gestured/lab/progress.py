"""A progress bar on standard error: one line that is rewritten at a terminal, a new line now and then elsewhere."""

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

from gestured.client.say import say_drawn

T = TypeVar("T")


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def progress(items: Iterable[T], total: int, title: str) -> Iterator[T]:
    """Pass `items` on and show how many of `total` are done and how long the rest will take."""
    start = shown = time.monotonic()
    terminal = sys.stderr.isatty()
    for done, item in enumerate(items, 1):
        yield item
        now = time.monotonic()
        if now - shown < (0.2 if terminal else 30.0) and done != total:
            continue
        shown = now
        rest = (now - start) / done * (total - done)
        bar = "#" * round(20 * done / total)
        text = f"{title:<28} [{bar:<20}] {done}/{total}  {_clock(now - start)} gone, {_clock(rest)} left"
        say_drawn(("\r" + text) if terminal else text, end="" if terminal else "\n", to=sys.stderr)
    if terminal:
        say_drawn("", to=sys.stderr)
