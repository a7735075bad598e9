"""A client of the event stream: its connection, its subscription, and the lines that wait for it.

A line is sent at once. Lines that the client's socket does not take wait in a bounded backlog, from which the oldest
are dropped; the loop waits for no client. The sockets are raw, since the buffer of an asyncio transport cannot drop its
oldest lines.
"""

import asyncio
import socket
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Protocol

from gestured.core import messages
from gestured.core.errors import ProtocolError
from gestured.core.events import Touch
from gestured.core.messages import MAX_LINE, Subscription, parse_subscription
from gestured.daemon.metrics import Metrics

BACKLOG_BYTES = 256 << 10  # the most bytes that wait for one client; beyond them the oldest lines are dropped
READ_BYTES = 1024  # the most bytes of one read; few, so that a client that sends rubbish waits its turn
TURNS = 20  # reads and answers of one client in a second; further ones wait for the next second

Finger = tuple[str, int, int]  # sensor, id of the contact, number of the finger


class _Server(Protocol):
    """What a client needs of the server that it belongs to, an `EventServer`, which says what each does."""

    loop: asyncio.AbstractEventLoop
    metrics: Metrics
    known: Callable[[], Mapping[str, Collection[str]]]  # `types`, `gestures`, `zones` that a client may name

    def subscribe(self, client: "Client", subscription: Subscription) -> None: ...
    def queue(self, client: "Client") -> None: ...
    def check(self, client: "Client") -> None: ...
    def remove(self, client: "Client") -> None: ...


class Client:
    """One connection: a socket, its subscription, and the lines that wait for it."""

    def __init__(self, server: _Server, sock: socket.socket) -> None:
        self._server, self.sock = server, sock
        self.subscription = Subscription()
        self.blocked_since: float | None = None  # monotonic s, since when its socket takes no bytes
        self.half_closed = False  # whether it will send no more, though it may go on reading
        self._begun = b""  # a line, or the rest of one, that is sent next and cannot be dropped
        self._waiting: deque[bytes] = deque()  # whole lines that come after `_begun`
        self._size = 0  # bytes of the lines in `_waiting`
        self._moves: dict[Finger, tuple[Touch, float]] = {}  # by finger: its waiting moves as one event, and the epoch
        self._lost = 0  # dropped lines that the client has not been told of
        self.turns = TURNS  # turns that it has left in this second
        self._request = bytearray()  # a line that is not complete
        self._asked: deque[bytes] = deque()  # requests that wait for an answer

    @property
    def backlog(self) -> int:
        """Bytes that wait for this client to read them."""
        return len(self._begun) + self._size

    def send(self, line: bytes) -> None:
        """Send a line now, or keep it; never blocks."""
        if self.blocked_since is not None:
            self._keep(line)
        elif (rest := self._write(line)) is not None:
            self._begun = rest if len(rest) < len(line) else b""
            if not self._begun:
                self._keep(line)
            self.blocked_since = time.monotonic()
            self._server.loop.add_writer(self.sock, self.flush)

    def touch(self, event: Touch, epoch: float, line: bytes) -> None:
        """Send a touch event, whose JSON is `line`. Waiting moves of a finger become one event and displace no line."""
        key = event.sensor, event.id, event.touch
        if key in self._moves:
            before, _ = self._moves.pop(key)
            event = replace(event, dx=round(before.dx + event.dx, 4), dy=round(before.dy + event.dy, 4))
            line = messages.to_json(event, epoch)
        if event.phase == "move" and self.blocked_since is not None:
            self._moves[key] = event, epoch
        else:
            self.send(line)

    def flush(self) -> None:
        """Send what waits, as far as the socket takes it."""
        while self.sock.fileno() >= 0:
            if self._begun:
                line, self._begun = self._begun, b""
            elif self._lost:
                line, self._lost = messages.lost_json(self._lost), 0
            elif self._waiting:
                line = self._waiting.popleft()
                self._size -= len(line)
            elif self._moves:
                line = messages.to_json(*self._moves.pop(next(iter(self._moves))))
            else:
                self.blocked_since = None
                self._server.loop.remove_writer(self.sock)
                return
            if (rest := self._write(line)) is not None:
                self._begun = rest  # whole or in part, it is sent next and cannot be dropped
                return
            self.blocked_since = time.monotonic()

    def read(self) -> None:
        """Read requests, and no more until they are answered. After an end of file the client may still take events."""
        self._server.loop.remove_reader(self.sock)
        self.turns -= 1
        try:
            data = self.sock.recv(READ_BYTES)
        except (BlockingIOError, InterruptedError):
            self.go_on()
            return
        except OSError:
            self._server.remove(self)
            return
        if not data:
            self.half_closed = True
            self._server.check(self)
            return
        *lines, rest = data.split(b"\n")
        for line in lines:
            self._asked.append(bytes(self._request + line))
            self._request.clear()
        self._request += rest
        del self._request[MAX_LINE + 1 :]  # one byte too many is enough to refuse it
        self.go_on()

    def answer(self) -> None:
        """Answer the oldest request that waits."""
        self.turns -= 1
        try:
            self._server.subscribe(self, parse_subscription(self._asked.popleft(), self._server.known()))
        except ProtocolError as error:
            self.send(messages.error_json(str(error)))
        self.go_on()

    def go_on(self) -> None:
        """Have the client's next line answered, or its socket read, unless its turns are used up or it is gone."""
        if self.turns > 0 and self.sock.fileno() >= 0:
            if self._asked:
                self._server.queue(self)
            elif not self.half_closed:
                self._server.loop.add_reader(self.sock, self.read)

    def new_second(self) -> None:
        """Give the client all its turns again."""
        used_up, self.turns = self.turns <= 0, TURNS
        if used_up:
            self.go_on()

    def _write(self, line: bytes) -> bytes | None:
        """Send a line. Returns what the socket did not take, or None if it took everything (or is gone)."""
        try:
            sent = self.sock.send(line)
        except (BlockingIOError, InterruptedError):
            return line
        except OSError:
            self._server.remove(self)
            return None
        if sent == len(line):
            return None
        self.blocked_since = time.monotonic()
        return line[sent:]

    def _keep(self, line: bytes) -> None:
        self._waiting.append(line)
        self._size += len(line)
        while self._size > BACKLOG_BYTES:
            self._size -= len(self._waiting.popleft())
            self._lost += 1
            self._server.metrics.lost_lines.add()
