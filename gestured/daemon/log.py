"""The log, on standard error: readable at a terminal, JSON otherwise. Nothing is logged per packet.

A thread of its own writes it, so that a reader who has stopped reading holds up neither the loop nor the daemon's end.
"""

import math
import os
import select
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import structlog

PERIOD_S = 10.0  # the period in which the number of lines of one reason is bounded
REASONS = 64  # more than there are; a bound in case a peer can choose a reason
WAITING_BYTES = 256 << 10  # bytes of lines that wait for a reader at most; later lines are thrown away, and counted
LAST_S = 0.5  # how long the end waits for a reader to take the last lines
STDOUT, STDERR = 1, 2


def configure(level: str) -> None:
    """Set structlog up once, or again with another level ("debug", "info", "warning", "error")."""
    tty = sys.stderr is not None and sys.stderr.isatty()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            *([] if tty else [structlog.processors.format_exc_info]),
            # Texts are escaped as in Python: a name that an operator sends must not act on the terminal.
            structlog.dev.ConsoleRenderer(repr_native_str=True) if tty else structlog.processors.JSONRenderer(),
        ],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=lambda *_: _Printer(),
        cache_logger_on_first_use=False,
    )


class LineWriter:
    """Writes lines to a descriptor, in their order; no caller waits.

    It uses a thread, since the descriptor is shared: made non-blocking, it would be so for the shell that started us.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._lines: deque[bytes] = deque()  # the first one stays until it is written
        self._size = 0
        self._lost = 0
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="log", daemon=True)
        self._thread.start()

    def put(self, line: str) -> None:
        """Have a line written, or count it as lost if too much waits already."""
        data = line.encode(errors="backslashreplace") + b"\n"
        with self._changed:
            if self._lost or self._size + len(data) > WAITING_BYTES:
                self._lost += 1  # later lines are lost, too, until their number is logged in the place of all of them
            else:
                self._lines.append(data)
                self._size += len(data)
                self._changed.notify()

    def close(self) -> None:
        """Take no more lines, and wait at most LAST_S until all are written."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(LAST_S)

    def _run(self) -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())  # signals are for the loop's thread
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._lines or self._lost or self._closed)
                line = self._lines[0] if self._lines else None
                if line is None:
                    lost, self._lost = self._lost, 0
                    if not lost:
                        return
            if line is None:
                log.warning("log lines were thrown away, nobody read them", count=lost)
                continue
            self._write(line)
            with self._changed:
                self._size -= len(self._lines.popleft())

    def _write(self, data: bytes) -> None:
        while data:
            try:
                data = data[os.write(self._descriptor, data) :]
            except BlockingIOError:  # another program that shares the descriptor has made it non-blocking
                select.select([], [self._descriptor], [])
            except OSError:
                return  # the reader is gone, or the disk full: the line is thrown away


_errors: LineWriter | None = None


def print_log(line: str) -> None:
    """Have a line written to standard error, if there is one; nothing is written once the interpreter is ending.

    Objects that are collected then may still log, but a thread that is started then never runs, and its starter waits
    forever.
    """
    global _errors
    if sys.stderr is not None and not sys.is_finalizing():
        _errors = _errors or LineWriter(STDERR)
        _errors.put(line)


def print_line(line: str) -> None:
    """Write one line to standard output, if there is one; waits at most LAST_S for a reader."""
    if sys.stdout is not None:
        writer = LineWriter(STDOUT)
        writer.put(line)
        writer.close()


def close() -> None:
    """Give the log's reader LAST_S to take the last lines. A later line opens the log again."""
    global _errors
    if _errors is not None:
        _errors.close()
        _errors = None


class _Printer:
    """The logger to which structlog hands finished lines."""

    def msg(self, line: str) -> None:
        print_log(line)

    debug = info = warning = error = exception = critical = msg


log: Any = structlog.get_logger()


class Throttle:
    """Logs the first lines of each reason at once, and counts further ones; a line after PERIOD_S has the count."""

    def __init__(self, clock: Callable[[], float] = time.monotonic, burst: int = 1) -> None:
        """`burst` is how many lines of one reason there are in PERIOD_S."""
        self._clock, self._burst = clock, burst
        self._state: dict[str, list[float]] = {}  # reason -> [when its period began, lines in it, count since the last]

    def info(self, event: str, reason: str, /, **fields: Any) -> None:
        """Log `event` with `reason` at a bounded rate: something that somebody did."""
        self._say(log.info, event, reason, fields)

    def warn(self, event: str, reason: str, /, **fields: Any) -> None:
        """Log `event` with `reason` at a bounded rate: something that is wrong."""
        self._say(log.warning, event, reason, fields)

    def error(self, event: str, reason: str, /, **fields: Any) -> None:
        """Log a bug that is being handled, with its traceback, at a bounded rate."""
        self._say(log.exception, event, reason, fields)

    def _say(self, method: Callable[..., None], event: str, reason: str, fields: dict[str, Any]) -> None:
        now = self._clock()
        if reason not in self._state and len(self._state) >= REASONS:
            reason = "other"
        state = self._state.setdefault(reason, [-math.inf, 0, 0])
        if now - state[0] >= PERIOD_S:
            state[:2] = now, 0
        state[2] += 1
        if state[1] < self._burst:
            method(event, reason=reason, count=int(state[2]), **fields)
            state[1:] = state[1] + 1, 0
