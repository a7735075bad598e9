"""A client of the daemon's event socket: JSON Lines over a Unix stream socket."""

import json
import socket
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from gestured.core.errors import GesturedError

PROTOCOL = 1


class Unreachable(GesturedError):
    """No daemon answers on the socket."""


class Refused(GesturedError):
    """The daemon answered something that this client cannot go on with."""


class Stream:
    """One connection. `hello` is the daemon's first line; iterate for the lines after it."""

    def __init__(self, path: Path, subscribe: Mapping[str, Sequence[str]] | None = None) -> None:
        """Connect and subscribe (None: gestures only). Raises Unreachable or Refused."""
        self.path = path
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self.socket.connect(str(path))
            self._lines = self.socket.makefile("rb")
            first = self._lines.readline()
        except OSError as error:
            self.socket.close()
            reason = error.strerror or error
            raise Unreachable(f"no daemon on {path}: {reason}; start gestured, or name its --socket") from None
        self.hello = parsed(first, path)
        if self.hello.get("type") != "hello" or self.hello.get("protocol") != PROTOCOL:
            self.close()
            raise Refused(f"{path} does not speak protocol {PROTOCOL} of gestured: {first[:80]!r}")
        self.hello_line = first.decode().rstrip("\n")
        if subscribe is not None:
            self.socket.sendall(json.dumps({"subscribe": subscribe}).encode() + b"\n")

    def raw(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Each line as it came, and parsed; ends when the daemon closes the connection."""
        try:
            for line in self._lines:
                message = parsed(line, self.path)
                yield line.decode().rstrip("\n"), message
        except ConnectionError:
            return

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (message for _, message in self.raw())

    def close(self) -> None:
        """Shut the connection; a reader in another thread comes to its end."""
        try:
            self.socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        self.socket.close()


def parsed(line: bytes, path: Path) -> dict[str, Any]:
    """One line as an object; raises Refused for anything else."""
    try:
        message = json.loads(line)
    except ValueError:
        message = None
    if not isinstance(message, dict):
        raise Refused(f"{path} sent a line that is no JSON object: {line[:80]!r}")
    return message
