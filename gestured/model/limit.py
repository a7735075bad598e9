"""The limit of a model's runs: one that takes too long is ended, as onnxruntime checks `terminate` between operators.

One thread watches all models of the process. It looks now and then while models are run, and is woken only for a limit
that ends before its next look, since waking it for each run would make every run slower. A single operator that never
ends is not ended by this, but by the watchdog outside of the process.

Nothing is ended before `hurry` was called: if nobody waits for answers, as in the laboratory or in a replay, a busy
machine must not change them.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

LOOK_S = 1.0  # the pause between two looks: shorter than a segment's limit, so that no such run wakes the thread
AWAKE_S = 60.0  # the thread goes on looking for so long after the last run
ASLEEP_S = 3600.0  # the pause if nothing was run for AWAKE_S; the next run ends it

_running: dict[int, tuple[float, Any]] = {}  # by id of its options, of each run: its end in s (monotonic), and these
_changed = threading.Condition()
_thread: threading.Thread | None = None
_used = 0.0  # s, when a model was last run
_hurried = False
_looks = 0.0  # s, the thread's next look


def hurry() -> None:
    """End runs that take too long from now on, since somebody waits for the answers of this process."""
    global _hurried
    _hurried = True


@contextmanager
def limited(options: Any, seconds: float) -> Iterator[None]:
    """Set `terminate` of `options`, onnxruntime's RunOptions and new for each run, if the block takes too long."""
    global _thread, _used
    if not _hurried:
        yield
        return
    with _changed:
        if _thread is None:
            _thread = threading.Thread(target=_watch, name="run limit", daemon=True)
            _thread.start()
        _used = time.monotonic()
        _running[id(options)] = _used + seconds, options
        if _used + seconds < _looks:
            _changed.notify()
    try:
        yield
    finally:
        with _changed:
            _running.pop(id(options), None)


def _watch() -> None:
    global _looks
    with _changed:
        while True:
            now = time.monotonic()
            for key, (end, options) in tuple(_running.items()):
                if end <= now:
                    options.terminate = True
                    del _running[key]
            _looks = now + (LOOK_S if now - _used < AWAKE_S else ASLEEP_S)
            _looks = min([_looks, *(end for end, _ in _running.values())])
            _changed.wait(_looks - now)
