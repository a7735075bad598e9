"""A client of the daemon's event socket."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from gestured.client.fields import wrong_field
from gestured.client.lines import Lines, Refused, Unreachable

PROTOCOL = 1
GREETING_S = 10.0  # to wait for the hello, which a daemon sends at once
SILENT = f"says nothing within {GREETING_S:g} s: it hangs, or this is not its event socket (--socket)"


class Stream(Lines):
    """One connection to an event socket. `hello` is its first line; iterating gives the lines after it."""

    def __init__(self, path: Path, subscribe: Mapping[str, Sequence[str]] | None = None) -> None:
        """Connect and subscribe (None: gestures only). Raises Unreachable or Refused."""
        super().__init__(path, "--socket")
        try:
            self.socket.settimeout(GREETING_S)
            try:
                first = next(self.raw(), None)
            except TimeoutError:
                raise Unreachable(f"the daemon on {path} {SILENT}") from None
            self.socket.settimeout(None)
            if first is None:
                raise Unreachable(f"the daemon on {path} closed the connection")
            line, self.hello = first
            check_hello(line, self.hello, path)
        except BaseException:
            self.close()
            raise
        if subscribe is not None:
            self.socket.sendall(json.dumps({"subscribe": subscribe}).encode() + b"\n")

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return self.lines()


def check_hello(line: str, message: Mapping[str, Any], path: Path) -> None:
    """Raises Refused unless the first line on `path` is the hello of a daemon that this client understands."""
    if message.get("type") != "hello" or message.get("protocol") != PROTOCOL:
        raise Refused(f"{path} does not speak protocol {PROTOCOL} of gestured: {line[:80]!r}")
    if words := wrong_field(message):
        raise Refused(f"{path} is not served by gestured, its hello is wrong: {words}")
