"""The event stream: JSON lines to any number of clients on a Unix socket. A line is encoded once for all of them."""

import asyncio
import resource
import select
import socket
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress

from gestured.core import messages
from gestured.core.events import Event, Touch
from gestured.core.messages import Subscription
from gestured.daemon.audience import Audience
from gestured.daemon.client import Client
from gestured.daemon.log import Throttle
from gestured.daemon.metrics import Metrics
from gestured.daemon.sockets import AGAIN_S, reason_of

CLIENTS = 1024  # connections at a time; each costs a descriptor, and at most BACKLOG_BYTES of memory
KEPT = 136  # descriptors that no client gets: they are for operators (20), bridges (20), metrics (64) and a reload
STALLED_S = 30.0  # a client that takes nothing for this long is cut off
LINES = 16  # requests of all clients that are answered before the loop serves frames again
ACCEPTED = 64  # connections that are accepted before the loop serves frames again
DRAINED_S = 0.01  # at the end, the pause between two checks whether lines still wait


class EventServer:
    """Accepts clients on a listening Unix socket, greets them with `hello()` and sends them events.

    `known()` are the `types`, `gestures` and `zones` that a client may name. `changed()` is called when the clients
    ask for other provisional or touch events than before.
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
        """Send an event to the clients that receive it; it is encoded once, and only if there are any."""
        if isinstance(event, Touch):
            self.audience.follow(event, epoch)
            return
        line = None
        for client in self.audience.of(event):
            line = line or messages.to_json(event, epoch, test=test)
            client.send(line)

    def tell(self, line: bytes) -> None:
        """Send a line that is no event to every client, whatever its subscription is."""
        for client in tuple(self._clients):
            client.send(line)

    def subscribe(self, client: Client, subscription: Subscription) -> None:
        """Change a client's subscription."""
        if client not in self._clients:
            return  # the client went while it was being answered
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
        """Remove a client that has hung up unnoticed, or has taken nothing for STALLED_S."""
        if client.half_closed:
            poll = select.poll()
            poll.register(client.sock, 0)
            if any(flags & (select.POLLHUP | select.POLLERR) for _, flags in poll.poll(0)):
                self.remove(client)
                return
        if client.blocked_since is not None and time.monotonic() - client.blocked_since > STALLED_S:
            self.metrics.evicted.add("stalled")
            self._throttle.warn("client cut off", "stalled")
            self.remove(client)

    def queue(self, client: Client) -> None:
        """Call `answer` of a client when it is its turn."""
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
        """Check all clients, and give them their turns again; call it about once a second."""
        for client in tuple(self._clients):
            self.check(client)
            client.new_second()

    async def close(self, drain_s: float) -> None:
        """Accept no new clients, give the others `drain_s` seconds to read what waits for them, and hang up."""
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
            except OSError as error:  # out of descriptors: the socket stays readable, so a pause is needed
                self._throttle.warn("cannot accept a client", reason_of(error))
                self.loop.remove_reader(self._listener)
                self.loop.call_later(AGAIN_S, self.loop.add_reader, self._listener, self._accept)
                return
            sock.setblocking(False)
            descriptors, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
            # A new descriptor has the lowest free number, so that below it none is free.
            if (count := len(self._clients)) >= CLIENTS or 0 <= descriptors <= sock.fileno() + KEPT:
                self.metrics.evicted.add("too_many")
                self._throttle.warn("client turned away", "too many clients", limit=count)
                with sock, suppress(OSError):
                    sock.send(messages.error_json(f"more than {count} clients"))
                continue
            client = Client(self, sock)
            self._clients.add(client)
            self.subscribe(client, client.subscription)
            self.loop.add_reader(sock, client.read)
            client.send(self._hello())
