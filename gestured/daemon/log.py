"""Logs go to standard error: readable at a terminal, JSON otherwise. Nothing is logged per packet."""

import math
import os
import sys
import time
from collections.abc import Callable
from typing import Any, TextIO

import structlog

LEVELS = {"debug": 10, "info": 20, "warning": 30, "error": 40}
PERIOD_S = 10.0  # at most one line a reason in this time
REASONS = 64  # more reasons than there are; a bound in case one slips in that a peer can choose


def configure(level: str) -> None:
    """Set structlog up once, or again with another level ("debug", "info", "warning", "error")."""
    tty = sys.stderr is not None and sys.stderr.isatty()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            *([] if tty else [structlog.processors.format_exc_info]),
            structlog.dev.ConsoleRenderer() if tty else structlog.processors.JSONRenderer(),
        ],
        wrapper_class=structlog.make_filtering_bound_logger(LEVELS[level]),
        logger_factory=lambda *_: _Printer(),
        cache_logger_on_first_use=False,
    )


class _Printer:
    """Writes lines to standard error; one that nobody reads any more must not stop the daemon."""

    def msg(self, line: str) -> None:
        if sys.stderr is not None:
            say(sys.stderr, line)

    debug = info = warning = error = exception = critical = msg


def say(stream: TextIO, line: str) -> None:
    """Write a line at once. Where the other end is gone, this and all that follows is thrown away."""
    try:
        print(line, file=stream, flush=True)
    except OSError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())  # what is still buffered must not fail at the end either
        os.close(nowhere)


log: Any = structlog.get_logger()


class Throttle:
    """Say the first of each reason at once, then at most one line in PERIOD_S with how many there were."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._state: dict[str, list[float]] = {}  # reason -> [time of the last line, count since]

    def warn(self, event: str, reason: str, /, **fields: Any) -> None:
        """Log `event` with `reason` at a bounded rate."""
        self._say(log.warning, event, reason, fields)

    def error(self, event: str, reason: str, /, **fields: Any) -> None:
        """The same for a bug that is being handled, with its traceback."""
        self._say(log.exception, event, reason, fields)

    def _say(self, method: Callable[..., None], event: str, reason: str, fields: dict[str, Any]) -> None:
        now = self._clock()
        if reason not in self._state and len(self._state) >= REASONS:
            reason = "other"
        state = self._state.setdefault(reason, [-math.inf, 0])
        state[1] += 1
        if now - state[0] >= PERIOD_S:
            method(event, reason=reason, count=int(state[1]), **fields)
            state[0], state[1] = now, 0
