"""A Unix stream socket on which the daemon speaks JSON Lines."""

import os
import queue
import socket
import threading
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Self, TypeVar

from gestured.client.address import SOCKET_PATH, SOCKET_PATH_BYTES
from gestured.client.peer import Stranger, check_peer
from gestured.core.errors import GesturedError
from gestured.core.messages import json_object

T = TypeVar("T")
JOIN = 'sudo usermod -aG gestured,gestured-events "$USER", and log in again'


class Unreachable(GesturedError):
    """No daemon answers on the socket."""


class Forbidden(Unreachable):
    """The socket exists, but this account may not connect to it."""


class Refused(GesturedError):
    """The daemon answered something that this client cannot go on with."""


class Unsubscribed(Refused):
    """The daemon refused the subscription of a client."""


class Lines:
    """One connection to a daemon's Unix socket; a context manager."""

    def __init__(self, path: Path, flag: str) -> None:
        """Connect to `path`; `flag` is the option that an error names. Raises Unreachable (or Forbidden), Stranger.

        It does not wait for a daemon whose queue is full. Raises GesturedError for a path that no socket can have.
        """
        if "\0" in str(path) or len(os.fsencode(path)) > SOCKET_PATH_BYTES:
            raise GesturedError(f"{str(path)!r}: expected {SOCKET_PATH}")
        self.path = path
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.setblocking(False)
        try:
            self.socket.connect(str(path))
        except OSError as error:
            self.socket.close()
            if isinstance(error, BlockingIOError):
                raise Unreachable(f"the daemon on {path} takes no more connections: it hangs, or is busy") from None
            if isinstance(error, PermissionError):
                raise Forbidden(f"{path}: {error.strerror}: it is for members of its group") from None
            reason = error.strerror or error
            raise Unreachable(f"no daemon on {path}: {reason}; start gestured, or name its {flag}") from None
        self.socket.setblocking(True)
        try:
            check_peer(self.socket, path, flag)
        except Stranger:
            self.socket.close()
            raise
        self._file = self.socket.makefile("rb")

    def lines(self) -> Iterator[dict[str, Any]]:
        """Each line, parsed from JSON; ends when the daemon closes the connection. Raises Refused."""
        try:
            for line in self._file:
                yield parsed(line, self.path)
        except ConnectionError:
            return

    def close(self) -> None:
        """Hang up; a reader in another thread comes to its end."""
        with suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)
        self.socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def read_ahead(lines: Iterable[T], most: int = 0) -> "queue.Queue[T | None]":
    """A queue that a thread fills with `lines`, at most `most` at a time (0: any number); None stands for their end."""
    waiting: queue.Queue[T | None] = queue.Queue(most)

    def read() -> None:
        try:
            with suppress(GesturedError):  # the reader of the queue finds the end of the lines
                for line in lines:
                    waiting.put(line)
        finally:
            waiting.put(None)

    threading.Thread(target=read, daemon=True).start()
    return waiting


def parsed(line: bytes, path: Path) -> dict[str, Any]:
    """The JSON object in a line from the socket at `path`; raises Refused for anything else."""
    message = json_object(line)
    if message is None:
        raise Refused(f"{path} sent a line that is no JSON object: {line[:80]!r}")
    return message
