"""The signals that ask a program to end: SIGTERM, Ctrl-C (SIGINT), or a terminal that is closed (SIGHUP)."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

ASKS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


def on_stop(act: Callable[[], object]) -> None:
    """Call `act` when a signal asks the program to end."""
    # Under `nohup` SIGHUP stays ignored, since the program is to outlive its terminal.
    asks = [number for number in ASKS if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN]
    for number in asks:
        signal.signal(number, lambda *_: act())
    signal.pthread_sigmask(signal.SIG_UNBLOCK, asks)  # a process inherits blocked signals from its parent


def stop_as_by_ctrl_c() -> None:
    """Turn each signal that asks for the end into a KeyboardInterrupt, so that a program can end its children."""
    on_stop(partial(signal.default_int_handler, signal.SIGINT, None))


@contextmanager
def stop_later() -> Iterator[None]:
    """A context that is not interrupted: a signal that asks for the end becomes a KeyboardInterrupt after it."""
    before = {number: signal.getsignal(number) for number in ASKS}
    asked: list[bool] = []
    on_stop(lambda: asked.append(True))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if asked:
            raise KeyboardInterrupt


@contextmanager
def ctrl_c_ends(status: int) -> Iterator[None]:
    """A context in which Ctrl-C ends the process at once, and raises nothing."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # such as in the background of a shell, which ignores it
        yield
        return
    signal.signal(signal.SIGINT, lambda *_: os._exit(status))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
