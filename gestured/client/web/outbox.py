"""The outbox of one browser: only the newest frame waits, and the latest few of all other events."""

import json
import threading
from collections import deque
from typing import Any

MOST = 200  # events that wait; a browser that was stalled shows no more


class Outbox:
    """The events that wait for one browser. Whoever puts one never waits; the thread of the browser takes all."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._frame: dict[str, Any] | None = None
        self._rest: deque[tuple[str, dict[str, Any]]] = deque(maxlen=MOST)
        self._closed = False

    def put(self, kind: str, what: dict[str, Any]) -> None:
        """Put a `frame` in the place of the one that waits, or another event after those that wait, the latest MOST."""
        with self._changed:
            if kind == "frame":
                self._frame = what
            else:
                self._rest.append((kind, what))
            self._changed.notify()

    def close(self) -> None:
        """Take no more; what waits is still given."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def take(self, patience_s: float) -> bytes | None:
        """All that waits, as server-sent events; a comment if nothing came for `patience_s`, None after `close`."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._frame or self._rest, patience_s)
            found = [*self._rest, *([("frame", self._frame)] if self._frame is not None else [])]
            self._rest.clear()
            self._frame = None
        if not found:
            return None if self._closed else b": nothing new\n\n"
        return b"".join(f"event: {kind}\ndata: {json.dumps(what)}\n\n".encode() for kind, what in found)
