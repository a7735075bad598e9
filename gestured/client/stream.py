"""A client of the daemon's event socket."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from gestured.client.lines import Lines, Refused, Unreachable

PROTOCOL = 1
PATIENCE_S = 10.0  # a daemon greets at once


class Stream(Lines):
    """One connection. `hello` is the daemon's first line; iterate for the lines after it."""

    def __init__(self, path: Path, subscribe: Mapping[str, Sequence[str]] | None = None) -> None:
        """Connect and subscribe (None: gestures only). Raises Unreachable or Refused."""
        super().__init__(path, "--socket")
        try:
            self.socket.settimeout(PATIENCE_S)
            try:
                first = next(self.raw(), None)
            except TimeoutError:
                said = f"says nothing within {PATIENCE_S:g} s: it hangs, or this is not its event socket (--socket)"
                raise Unreachable(f"the daemon on {path} {said}") from None
            self.socket.settimeout(None)
            if first is None:
                raise Unreachable(f"the daemon on {path} closed the connection")
            self.hello_line, self.hello = first
            if self.hello.get("type") != "hello" or self.hello.get("protocol") != PROTOCOL:
                raise Refused(f"{path} does not speak protocol {PROTOCOL} of gestured: {self.hello_line[:80]!r}")
        except BaseException:
            self.close()
            raise
        if subscribe is not None:
            self.socket.sendall(json.dumps({"subscribe": subscribe}).encode() + b"\n")

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return self.lines()
