"""The event stream: JSON lines to any number of clients on a Unix socket.

A line is encoded once and sent at once to each client that wants it. What a client's socket does not take waits in a
bounded backlog of its own, from which the oldest lines are dropped; the loop waits for nobody. Raw sockets instead of
transports: a transport's buffer has no bound that drops the oldest.
"""

import asyncio
import select
import socket
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

from gestured.core import messages
from gestured.core.errors import ProtocolError
from gestured.core.events import Cancelled, Event, Gesture, Provisional, Touch, Unknown
from gestured.core.messages import MAX_LINE, Subscription, parse_subscription
from gestured.daemon.log import Throttle
from gestured.daemon.metrics import Metrics
from gestured.daemon.sockets import AGAIN_S, reason_of

BACKLOG_BYTES = 256 << 10  # the most bytes that wait for one client; one that is further behind loses the oldest lines
READ_BYTES = 1024  # of one read; few, so that a client that sends rubbish waits its turn
TURNS = 20  # reads and lines of one client in a second; more of them wait for the next second
RUBBISH = 100  # bad lines without a good one between them after which a client is cut off: some seconds of nothing else
CLIENTS = 1024  # connections at a time; each costs a descriptor, and at most BACKLOG_BYTES of memory
STALLED_S = 30.0  # a client that takes nothing for this long is cut off
LINES = 16  # lines of all clients that are answered before the loop looks after its frames again
ACCEPTED = 64  # connections that are accepted before the loop looks after its frames again
DRAINED_S = 0.01  # at the end, the pause between two looks at what still waits

Finger = tuple[str, int, int]  # sensor, id of the contact, number of the finger


class Client:
    """One connection: a socket, what it wants, and what waits for it."""

    def __init__(self, server: "EventServer", sock: socket.socket) -> None:
        self._server, self.sock = server, sock
        self.subscription = Subscription()
        self.blocked_since: float | None = None  # monotonic s, since when its socket takes nothing more
        self.half_closed = False  # whether it will send no more, though it may go on reading
        self._begun = b""  # rest of a line of which the client already has a part
        self._waiting: deque[bytes] = deque()  # whole lines that come after `_begun`
        self._size = 0  # bytes of the lines in `_waiting`
        self._moves: dict[Finger, tuple[Touch, float]] = {}  # by finger: how it moved since, and the epoch
        self._lost = 0  # lines that were dropped, of which the client was not told so far
        self.turns = TURNS  # turns that it has left in this second
        self._request = bytearray()  # a line that is not complete
        self._asked: deque[bytes] = deque()  # lines that wait for an answer
        self._rubbish = 0  # bad lines since the last good one

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
        """Send a touch event, which `line` tells. Moves of a finger that wait are one: they displace nothing."""
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
        """Send what waits, as far as it goes."""
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
                self._begun = rest  # whole or in part: it goes first, and it is no longer dropped
                return
            self.blocked_since = time.monotonic()

    def read(self) -> None:
        """Take requests; an end of file only means that no more will come. No more is read until they are answered."""
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
            self._request += line
            if self._request.strip():
                self._asked.append(bytes(self._request))
            self._request.clear()
        self._request += rest
        if len(self._request) > MAX_LINE:
            del self._request[MAX_LINE + 1 :]  # one byte too many is enough to refuse it
            self._refuse()
        self.go_on()

    def answer(self) -> None:
        """Answer the oldest line that waits for it."""
        self.turns -= 1
        try:
            self._server.subscribe(self, parse_subscription(self._asked.popleft(), self._server.known()))
            self._rubbish = 0
        except ProtocolError as error:
            self.send(messages.error_json(str(error)))
            self._refuse()
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

    def _refuse(self) -> None:
        self._rubbish += 1
        if self._rubbish > RUBBISH:
            self._server.cut_off(self, "rubbish")

    def _write(self, line: bytes) -> bytes | None:
        """What the socket did not take, or None if it took everything (or is gone)."""
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


class Audience:
    """Clients by their subscriptions: an event is held against each subscription once, however many share it.

    Each `down` of a finger that a client is told of has exactly one `up`, whatever comes.
    """

    def __init__(self) -> None:
        self._classes: dict[Subscription, set[Client]] = {}
        self._owed: dict[tuple[str, int], set[Client]] = {}  # who was sent a provisional event
        self._down: dict[Finger, tuple[Touch, set[Client]]] = {}  # fingers that are down, and who was told so
        self._epoch = 0.0

    def change(self, client: Client, subscription: Subscription) -> bool:
        """Put a client with those that ask for the same. Returns whether nobody asks any more for what it asked for.

        Fingers that it is to follow now are down, for it, and those that it no longer follows are up.
        """
        last = self._leave(client)
        client.subscription = subscription
        self._classes.setdefault(subscription, set()).add(client)
        for event, clients in tuple(self._down.values()):
            wanted = subscription.matches(event)
            if wanted != (client in clients):
                now = replace(event, phase="down" if wanted else "up", dx=0.0, dy=0.0)
                (clients.add if wanted else clients.discard)(client)
                client.touch(now, self._epoch, messages.to_json(now, self._epoch))
        return last

    def forget(self, client: Client) -> bool:
        """A client is gone. Returns whether nobody asks any more for what it asked for."""
        for _, clients in self._down.values():
            clients.discard(client)
        return self._leave(client)

    def of(self, event: Event) -> list[Client]:
        """The clients that hear an event: those who ask for it or were sent the provisional event that it answers."""
        wanted = [client for asked, clients in self._classes.items() if asked.matches(event) for client in clients]
        if isinstance(event, Provisional):
            self._owed[event.sensor, event.id] = set(wanted)
        elif self._owed and isinstance(event, Gesture | Unknown | Cancelled):
            owed = self._owed.pop((event.sensor, event.id), set())
            wanted += [
                client
                for client in owed
                if client in self._classes.get(client.subscription, ()) and not client.subscription.matches(event)
            ]
        return wanted

    def follow(self, event: Touch, epoch: float) -> None:
        """Send an event of a finger to those who follow it: those who ask for it, from its `down` on."""
        finger, self._epoch = (event.sensor, event.id, event.touch), epoch
        if event.phase == "down":
            clients = set(self.of(event))
        else:
            _, clients = self._down.pop(finger)
        if event.phase != "up":
            self._down[finger] = event, clients
        line = messages.to_json(event, epoch) if clients else b""
        for client in tuple(clients):
            client.touch(event, epoch, line)

    def asked(self, kind: str) -> tuple[frozenset[str], bool]:
        """The sensors whose events of a type somebody asks for by name, and whether somebody asks for all."""
        named = [asked.sensors for asked in self._classes if kind in asked.types]
        return frozenset().union(*(names for names in named if names is not None)), None in named

    def _leave(self, client: Client) -> bool:
        members = self._classes.get(client.subscription, set())
        members.discard(client)
        return not members and self._classes.pop(client.subscription, None) is not None


class EventServer:
    """Accepts clients on a listening Unix socket, greets them with `hello()` and sends them events.

    `known()` are the `gestures` and `zones` that a client may ask for; `changed()` is called when they ask for other
    provisional or touch events.
    """

    def __init__(
        self,
        listener: socket.socket,
        hello: Callable[[], bytes],
        metrics: Metrics,
        *,
        known: Callable[[], Mapping[str, Collection[str]]],
        changed: Callable[[], None],
    ) -> None:
        self.known, self._changed = known, changed
        self.loop = asyncio.get_running_loop()
        self.metrics = metrics
        self._listener, self._hello, self._throttle = listener, hello, Throttle()
        self._clients: set[Client] = set()
        self.audience = Audience()
        self._queue: deque[Client] = deque()  # clients with a line that waits for its answer, each once
        self.loop.add_reader(listener, self._accept)

    @property
    def count(self) -> int:
        """How many clients there are."""
        return len(self._clients)

    @property
    def backlog(self) -> int:
        """Bytes that wait for all clients together."""
        return sum(client.backlog for client in tuple(self._clients))

    def publish(self, event: Event, epoch: float, *, test: bool = False) -> None:
        """Send an event to everyone who wants it; it is encoded once, and only if somebody does."""
        if isinstance(event, Touch):
            self.audience.follow(event, epoch)
            return
        line = None
        for client in self.audience.of(event):
            line = line or messages.to_json(event, epoch, test=test)
            client.send(line)

    def tell(self, line: bytes) -> None:
        """Send a line that is no event to every client, whatever it asks for."""
        for client in tuple(self._clients):
            client.send(line)

    def subscribe(self, client: Client, subscription: Subscription) -> None:
        """Change what a client wants."""
        if client not in self._clients:
            return  # it went while it was being answered
        before = client.subscription
        if (self.audience.change(client, subscription) and before.costly) or subscription.costly:
            self._changed()

    def remove(self, client: Client) -> None:
        """Forget a client that is gone."""
        if client in self._clients:
            self._clients.discard(client)
            if self.audience.forget(client) and client.subscription.costly:
                self._changed()
            self.loop.remove_reader(client.sock)
            self.loop.remove_writer(client.sock)
            client.sock.close()

    def check(self, client: Client) -> None:
        """Remove a client that has gone without a word, or has taken nothing for STALLED_S."""
        if client.half_closed:
            poll = select.poll()
            poll.register(client.sock, 0)
            if any(flags & (select.POLLHUP | select.POLLERR) for _, flags in poll.poll(0)):
                self.remove(client)
                return
        if client.blocked_since is not None and time.monotonic() - client.blocked_since > STALLED_S:
            self.cut_off(client, "stalled")

    def cut_off(self, client: Client, reason: str) -> None:
        """Remove a client that is a burden, and say so."""
        if client in self._clients:
            self.metrics.evicted.add(reason)
            self._throttle.warn("client cut off", reason)
            self.remove(client)

    def queue(self, client: Client) -> None:
        """Answer a client's next line when it is its turn."""
        self._queue.append(client)
        if len(self._queue) == 1:
            self.loop.call_soon(self._answer)

    def _answer(self) -> None:
        turn = [self._queue.popleft() for _ in range(min(LINES, len(self._queue)))]
        if self._queue:
            self.loop.call_soon(self._answer)
        for client in turn:
            if client in self._clients:
                client.answer()  # it may queue again, for a later turn

    def tick(self) -> None:
        """Look after all clients; call it about once a second."""
        for client in tuple(self._clients):
            self.check(client)
            client.new_second()

    async def close(self, drain_s: float) -> None:
        """Take no new clients, give the others `drain_s` seconds to read what waits, and end."""
        self.loop.remove_reader(self._listener)
        end = time.monotonic() + drain_s
        while any(client.backlog for client in self._clients) and time.monotonic() < end:
            await asyncio.sleep(DRAINED_S)
        for client in tuple(self._clients):
            self.remove(client)

    def _accept(self) -> None:
        for _ in range(ACCEPTED):
            try:
                sock, _ = self._listener.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:  # out of descriptors: the socket stays readable, so do not come back at once
                self._throttle.warn("cannot accept a client", reason_of(error))
                self.loop.remove_reader(self._listener)
                self.loop.call_later(AGAIN_S, self.loop.add_reader, self._listener, self._accept)
                return
            sock.setblocking(False)
            if len(self._clients) >= CLIENTS:
                self.metrics.evicted.add("too_many")
                self._throttle.warn("client turned away", "too many clients", limit=CLIENTS)
                with sock:
                    try:
                        sock.send(messages.error_json(f"more than {CLIENTS} clients"))
                    except OSError:
                        pass
                continue
            client = Client(self, sock)
            self._clients.add(client)
            self.subscribe(client, client.subscription)
            self.loop.add_reader(sock, client.read)
            client.send(self._hello())
