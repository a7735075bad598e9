"""A run of a model that takes too long is ended: onnxruntime looks at its options' `terminate` between two operators.

One thread for all models of the process, asleep unless something runs. A single operator that never ends is not
ended by this; that is the business of the watchdog outside.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_running: dict[int, tuple[float, Any]] = {}  # when its time is over (s, monotonic), and its options
_changed = threading.Condition()
_thread: threading.Thread | None = None


@contextmanager
def limited(options: Any, seconds: float) -> Iterator[None]:
    """Sets `options.terminate` (of onnxruntime's RunOptions, new for each run) when the block takes longer."""
    global _thread
    with _changed:
        if _thread is None:
            _thread = threading.Thread(target=_watch, name="run limit", daemon=True)
            _thread.start()
        _running[id(options)] = time.monotonic() + seconds, options
        _changed.notify()
    try:
        yield
    finally:
        with _changed:
            _running.pop(id(options), None)


def _watch() -> None:
    with _changed:
        while True:
            now = time.monotonic()
            for key, (end, options) in tuple(_running.items()):
                if end <= now:
                    options.terminate = True
                    del _running[key]
            _changed.wait(min((end for end, _ in _running.values()), default=now + 3600.0) - now)
