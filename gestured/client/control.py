"""A client of the daemon's control socket, which sends verbs and reads their answers."""

import json
import socket
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from gestured import __version__
from gestured.client.lines import Lines, Refused, Unreachable

ANSWER_TIMEOUT_S = 20.0  # a reload opens and tests a model; everything else takes milliseconds


class Control(Lines):
    """One connection to a control socket. Raises Unreachable if no daemon answers."""

    def __init__(self, path: Path, patience_s: float = ANSWER_TIMEOUT_S, flag: str = "--control") -> None:
        """Connect to `path`; `patience_s` is how long an answer may take. `flag` and errors are as of `Lines`."""
        super().__init__(path, flag)
        self._flag, self._patience_s = flag, patience_s
        self.finished = False  # whether `finish` was called

    def ask(self, verb: str, **parameters: object) -> dict[str, Any]:
        """The daemon's answer to a verb. Raises Refused with the daemon's reason, Unreachable if no answer comes."""
        request = {"verb": verb} | parameters
        with suppress(OSError):  # the daemon hung up; the reason that it sent before is read below
            self.socket.sendall(json.dumps(request).encode() + b"\n")
        self.socket.settimeout(self._patience_s)
        try:
            answer = next(self.lines(), None)
        except TimeoutError:
            said = f"does not answer within {self._patience_s:g} s: it hangs, or the machine is very busy"
            raise Unreachable(f"the daemon on {self.path} {said}") from None
        self.socket.settimeout(None)
        if answer is None:
            raise Unreachable(f"the daemon on {self.path} closed the connection")
        if "ok" not in answer:
            raise Refused(f"{self.path} is not the daemon's {self._flag} socket")
        if answer["ok"] is not True:
            raise Refused(f"{verb}: {answer.get('reason')}")
        return answer

    @contextmanager
    def reading(self) -> Iterator[None]:
        """A context in which lines are read: one with a missing or odd part, as of another version, raises Refused."""
        try:
            yield
        except (KeyError, TypeError, AttributeError, ValueError, OverflowError, struct.error) as error:
            said = f"says something that gestured {__version__} does not say ({type(error).__name__}: {error})"
            raise Refused(f"{self.path} {said}: are the daemon and this program of one version?") from error

    def finish(self) -> None:
        """End the requests: lines that are on their way still come, then `lines` ends. Any thread may call it."""
        self.finished = True
        with suppress(OSError):  # the daemon hung up already
            self.socket.shutdown(socket.SHUT_WR)
