"""How a program is asked to end: SIGTERM, Ctrl-C, or a terminal that is closed (SIGHUP)."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

ASKS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


def on_stop(act: Callable[[], object]) -> None:
    """Act when somebody asks for the end."""
    # `nohup` has SIGHUP ignored: its program needs no terminal.
    asks = [number for number in ASKS if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN]
    for number in asks:
        signal.signal(number, lambda *_: act())
    signal.pthread_sigmask(signal.SIG_UNBLOCK, asks)  # a process inherits blocked signals from its parent


def stop_as_by_ctrl_c() -> None:
    """Let whatever asks for the end be a KeyboardInterrupt: what the program has started ends, too."""
    on_stop(partial(signal.default_int_handler, signal.SIGINT, None))


@contextmanager
def stop_later() -> Iterator[None]:
    """Let whoever asks for the end wait until something is whole; then it is a KeyboardInterrupt."""
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
