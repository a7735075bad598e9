"""What waits for one browser: of frames the newest alone, of the rest the latest few."""

import json
import threading
from collections import deque
from typing import Any

MOST = 200  # events that wait; a browser that was stalled shows no more


class Outbox:
    """Filled by those who hear the daemon, emptied by the thread that serves the browser; nobody waits to fill it."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._frame: dict[str, Any] | None = None
        self._rest: deque[tuple[str, dict[str, Any]]] = deque(maxlen=MOST)
        self._closed = False

    def frame(self, frame: dict[str, Any]) -> None:
        """A frame takes the place of the one that waits."""
        with self._changed:
            self._frame = frame
            self._changed.notify()

    def put(self, kind: str, what: dict[str, Any]) -> None:
        """Something that must not be passed over, unless far too much of it waits."""
        with self._changed:
            self._rest.append((kind, what))
            self._changed.notify()

    def close(self) -> None:
        """Nothing more will come after what waits."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def take(self, patience_s: float) -> bytes | None:
        """All that waits, as server-sent events; a comment where nothing came for so long, None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._frame or self._rest, patience_s)
            found = [*self._rest, *([("frame", self._frame)] if self._frame is not None else [])]
            self._rest.clear()
            self._frame = None
        if not found:
            return None if self._closed else b": nothing new\n\n"
        return b"".join(f"event: {kind}\ndata: {json.dumps(what)}\n\n".encode() for kind, what in found)
