"""A subscriber: the events of a daemon, or of several, across their restarts."""

import json
import logging
import math
import os
import selectors
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from threading import Lock
from typing import Any, Self

from gestured.client.fields import wrong_field
from gestured.client.lines import Forbidden, Lines, Refused, Unreachable, Unsubscribed, parsed
from gestured.core.errors import GesturedError

FIRST_S, LONGEST_S = 0.1, 2.0  # between attempts to connect, doubled each time; a restart takes a second
CHUNK = 65536  # the most bytes of one read
LINE_BYTES = 4 << 20  # of a line, at most; a hello with all sensors that a daemon can keep has an eighth of these
PROTOCOL = 1
GREETING_S = 10.0  # to wait for the hello, which a daemon sends at once, and for a status, which comes each second
SILENT = f"says nothing within {GREETING_S:g} s: it hangs, or this is not its event socket (--socket)"
LOG = logging.getLogger("gestured")


class Subscriber:
    """An iterator over events, which are dicts as on the socket; also a context manager.

    It connects when it is first iterated, and again whenever a daemon goes and returns. A `lost` line is given as an
    event, a `hello` line is not: the attribute `hello` is that of the daemon whose event was given last, and `path` is
    its socket. When a daemon has started again, `instance` in its `hello` is another, and `sequence` counts anew. A
    line in which a field is missing, or has another type than the protocol says, is skipped and reported to `say`.
    If `status` is among the types, a daemon that says nothing for ten seconds hangs, and counts as gone.

    One thread iterates; any thread may `close` it, which ends the iteration. In a forked child it connects anew.
    """

    def __init__(  # noqa: PLR0913 - keywords, each a choice of its own
        self,
        *paths: str | PathLike[str],
        types: Sequence[str] | None = None,
        sensors: Sequence[str] | None = None,
        gestures: Sequence[str] | None = None,
        zones: Sequence[str] | None = None,
        timeout: float | None = None,
        reconnect: bool = True,
        say: Callable[[str], None] = LOG.warning,
    ) -> None:
        """`paths` are event sockets; the filters are those of the protocol, and None is the protocol's default.

        `say` is called with a sentence about each line that is skipped.

        Iterating raises TimeoutError after `timeout` seconds without an event, and may then go on. All other errors are
        GesturedErrors and close the subscriber: Refused if a daemon refuses the subscription or the peer is no daemon,
        Stranger if an account that we do not trust serves the socket, Forbidden if we may not connect to it, and
        without `reconnect` Unreachable if no daemon is there (any more).
        """
        if not paths:
            raise TypeError("Subscriber: expected the path of at least one event socket")
        self.hello: dict[str, Any] = {}
        self.path = Path(paths[0])
        self._paths = [Path(path) for path in paths]
        wanted = {"types": types, "sensors": sensors, "gestures": gestures, "zones": zones}
        # A text is passed on as it is, since the daemon's error about a text is clearer than one about its letters.
        given = {key: v if isinstance(v, str) else list(v) for key, v in wanted.items() if v is not None}
        self._request = json.dumps({"subscribe": given}).encode() + b"\n" if given else b""
        # Whether a daemon that says nothing must hang: one that is asked for its status tells it each second.
        self._alive = types is not None and "status" in types
        self._timeout, self._reconnect, self._say = timeout, reconnect, say
        self._closed = False
        self._begin()

    def _begin(self) -> None:
        """Start without connections and with a new lock, also in a forked child, which would share its parent's."""
        self._pid, self._iterating = os.getpid(), Lock()
        self._sources = [_Source(path) for path in self._paths]
        self._unread: deque[tuple[_Source, bytes]] = deque()
        self._selector = selectors.DefaultSelector()
        self._wake, self._woken = socket.socketpair()
        self._selector.register(self._woken, selectors.EVENT_READ)

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> dict[str, Any]:
        end = self._end()  # it holds across hellos, since a daemon that restarts again and again sends no event
        while (line := self._next_line(end)) is not None:
            if line[1].get("type") != "hello":
                return line[1]
        raise StopIteration

    def lines(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Each line as it came, and parsed; also the `hello` of each connection."""
        while (line := self._next_line(self._end())) is not None:
            yield line

    @property
    def connected(self) -> bool:
        """Whether every daemon has sent its `hello` and has not hung up since."""
        return all(source.hello for source in self._sources)

    def close(self) -> None:
        """End the iteration and hang up; a second call does nothing. Any thread and any signal handler may call it.

        In a forked child it leaves the parent's connections as they are.
        """
        self._closed = True
        if os.getpid() != self._pid:
            return
        with suppress(OSError):  # the subscriber is closed already
            self._wake.send(b".")
        if self._iterating.acquire(blocking=False):  # else the thread that iterates does this
            for source in self._sources:
                if source.lines is not None:
                    source.lines.close()
                    source.lines = None
            self._selector.close()
            self._wake.close()
            self._woken.close()
            self._iterating.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _end(self) -> float:
        """Until when to wait from now on, in monotonic s."""
        return math.inf if self._timeout is None else time.monotonic() + self._timeout

    def _next_line(self, end: float) -> tuple[str, dict[str, Any]] | None:
        """The next line; None once the subscriber is closed. Raises TimeoutError if none has come by `end`."""
        try:
            if os.getpid() != self._pid:
                self._begin()
            with self._iterating:
                while not self._closed:
                    if self._unread:
                        if (found := self._read(*self._unread.popleft())) is not None:
                            return found
                        continue
                    over = time.monotonic() >= end
                    self._wait(end)
                    if over and not self._unread and not self._closed:
                        faults = filter(None, (source.fault for source in self._sources))
                        raise TimeoutError(": ".join((f"no event within {self._timeout:g} s", *faults)))
        except GesturedError:
            self._closed = True
            raise
        finally:
            if self._closed:
                self.close()
        return None

    def _wait(self, end: float) -> None:
        """Wait until a line has come, a connection is due, or it is `end` (monotonic seconds)."""
        now = time.monotonic()
        for source in self._sources:
            if source.due <= now and source.lines is None:
                self._call(source, now)
        until = min(end, *(source.due for source in self._sources))
        said = [key.data for key, _ in self._selector.select(None if until == math.inf else max(until - now, 0.0))]
        for source in self._sources:
            if source in said:
                self._receive(source)
            elif source.due <= now and source.lines is not None:
                self._gone(source, Unreachable(f"the daemon on {source.path} {SILENT}"))

    def _call(self, source: "_Source", now: float) -> None:
        try:
            source.lines = Lines(source.path, "--socket")
        except Forbidden:  # another attempt would change nothing
            raise
        except Unreachable as error:
            self._gone(source, error)
            return
        with suppress(ConnectionError):  # the daemon hung up, but its last lines are still read
            source.lines.socket.sendall(self._request)
        source.lines.socket.setblocking(False)
        self._selector.register(source.lines.socket, selectors.EVENT_READ, source)
        source.due = now + GREETING_S  # by then its hello must have come

    def _receive(self, source: "_Source") -> None:
        assert source.lines is not None
        try:
            data = source.lines.socket.recv(CHUNK)
        except ConnectionError:
            data = b""
        if not data:
            self._gone(source, Unreachable(f"the daemon on {source.path} closed the connection"))
            return
        *lines, rest = data.split(b"\n")
        for line in lines:
            self._unread.append((source, bytes(source.begun) + line))
            source.begun.clear()
        source.begun += rest  # in place: no piece of a line is copied again
        if len(source.begun) > LINE_BYTES:
            raise Refused(
                f"{source.path} sent a line of more than {LINE_BYTES >> 20} MiB: it is not served by gestured"
            )

    def _read(self, source: "_Source", line: bytes) -> tuple[str, dict[str, Any]] | None:
        """A line, and parsed; None if it is skipped, or only says that the daemon has no place for us now."""
        message = parsed(line, source.path)
        text = line.decode()
        if message.get("type") == "error":
            refusal = f"the daemon on {source.path} refused the request: {message.get('reason')}"
            if source.hello:
                raise Unsubscribed(refusal)
            self._gone(source, Unreachable(refusal))
            return None
        source.due = time.monotonic() + GREETING_S if self._alive else math.inf
        if not source.hello:
            _check_hello(text, message, source.path)
            source.hello, source.wait_s, source.fault = message, FIRST_S, ""
        elif words := wrong_field(message):
            self._say(f"a line of the daemon on {source.path} is passed over: {words}")
            return None
        self.hello, self.path = source.hello, source.path
        return text, message

    def _gone(self, source: "_Source", error: Unreachable) -> None:
        """Drop the connection to a daemon that is gone, and try again later. Without `reconnect` raises the error."""
        if not self._reconnect:
            raise error
        if source.lines is not None:
            self._selector.unregister(source.lines.socket)
            source.lines.close()
        source.lines, source.hello, source.fault = None, {}, str(error)
        self._unread = deque(line for line in self._unread if line[0] is not source)  # of no connection now
        source.begun.clear()
        source.due = time.monotonic() + source.wait_s
        source.wait_s = min(2.0 * source.wait_s, LONGEST_S)


def _check_hello(line: str, message: Mapping[str, Any], path: Path) -> None:
    """Raises Refused unless the first line on `path` is the hello of a daemon that this client understands."""
    if message.get("type") != "hello" or message.get("protocol") != PROTOCOL:
        raise Refused(f"{path} does not speak protocol {PROTOCOL} of gestured: {line[:80]!r}")
    if words := wrong_field(message):
        raise Refused(f"{path} is not served by gestured, its hello is wrong: {words}")


@dataclass(eq=False)
class _Source:
    """One event socket, connected or not."""

    path: Path
    lines: Lines | None = None
    hello: dict[str, Any] = field(default_factory=dict)  # the hello of this connection; empty until it came
    begun: bytearray = field(default_factory=bytearray)  # the part of a line whose end has not come yet
    due: float = 0.0  # monotonic s: when to connect, or by when the next line must have come
    wait_s: float = FIRST_S  # how long to wait after the next failure
    fault: str = ""  # why it is not connected (any more)
