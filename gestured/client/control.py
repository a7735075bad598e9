"""A client of the daemon's control socket: ask a verb, get an answer."""

import json
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gestured.client.stream import Refused, Unreachable, parsed

PATIENCE_S = 20.0  # a reload opens and tests a model; everything else takes milliseconds


class Control:
    """One connection; a context manager. Raises Unreachable where no daemon answers."""

    def __init__(self, path: Path, patience_s: float = PATIENCE_S) -> None:
        """`patience_s` is how long an answer may take."""
        self.path, self._patience_s = path, patience_s
        self.finished = False  # it was we who ended it
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self.socket.connect(str(path))
        except OSError as error:
            self.socket.close()
            reason = error.strerror or error
            raise Unreachable(f"no daemon on {path}: {reason}; start gestured, or name its --control") from None
        self._lines = self.socket.makefile("rb")

    def ask(self, verb: str, **parameters: object) -> dict[str, Any]:
        """What the daemon answers. Raises Refused with its reason, Unreachable where no answer comes."""
        request = {"verb": verb} | parameters
        try:
            self.socket.sendall(json.dumps(request).encode() + b"\n")
        except OSError:
            pass  # it hung up; what it said before that is worth more
        self.socket.settimeout(self._patience_s)
        try:
            answer = next(self.lines(), None)
        except TimeoutError:
            said = f"does not answer within {self._patience_s:g} s: it hangs, or the machine is very busy"
            raise Unreachable(f"the daemon on {self.path} {said}") from None
        self.socket.settimeout(None)
        if answer is None:
            raise Unreachable(f"the daemon on {self.path} closed the connection")
        if answer.get("ok") is not True:
            raise Refused(f"{verb}: {answer.get('reason')}")
        return answer

    def lines(self) -> Iterator[dict[str, Any]]:
        """What the daemon sends, line by line, until it hangs up."""
        try:
            for line in self._lines:
                yield parsed(line, self.path)
        except ConnectionError:
            return

    def finish(self) -> None:
        """Ask for no more: what is on its way still comes, then `lines` ends. Any thread may call it."""
        self.finished = True
        try:
            self.socket.shutdown(socket.SHUT_WR)
        except OSError:
            pass  # it hung up already

    def close(self) -> None:
        """Hang up; a reader in another thread comes to its end."""
        try:
            self.socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        self.socket.close()

    def __enter__(self) -> "Control":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
