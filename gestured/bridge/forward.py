"""Frames that come in over Zenoh, on their way to the daemon's UDP port.

Zenoh drops what does not fit through the way to us, whoever sent it, so one sender that floods its key would silence
all others. While one does, the others that are known are each subscribed to by their own key instead of all by a
wildcard: the routers then do not send us the flood at all.
"""

import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gestured.bridge.counts import Counts
from gestured.client.sensor import connected, sent_after_refusal
from gestured.core.address import Address, is_sensor
from gestured.core.errors import GesturedError, ProtocolError
from gestured.core.osc import decode

MOST_SENDERS = 512  # sensors from Zenoh, each with a socket of its own: the daemon shares its work out by sources
SILENT_S = 60.0  # a sender that says nothing for so long gives its place to another, as in the daemon
MOST_HZ = 2000.0  # packets of one sender: twice what the fastest sensor sends
BURST_S = 1.0  # for which a sender may be ahead of that: what was held up on its way comes at once
APART_S = 20.0  # for which a flood is kept away; senders that are not known then are not heard
LOOK_S = 0.25  # for which everybody is heard again after that, so that others become known


@dataclass(slots=True)
class _Sender:
    """A sensor that sends through Zenoh."""

    socket: socket.socket
    due: float  # monotonic s, when the next packet would come at MOST_HZ

    def floods(self, now: float) -> bool:
        """Count a packet, unless it is one too many."""
        if self.due > now + BURST_S:
            return True
        self.due = max(self.due, now) + 1.0 / MOST_HZ
        return False


class Forward:
    """Frames from Zenoh to the daemon, byte by byte as they came: their counter and time stay."""

    def __init__(self, site: str, to: Address, counts: Counts, clock: Callable[[], float] = time.monotonic) -> None:
        """`site` is what all keys begin with. Raises GesturedError where `to` is no address."""
        self._site, self._counts, self._clock = site, counts, clock
        with connected(to) as found:  # a name is looked up once
            self._to = Address(*found.getpeername()[:2])
        self._senders: dict[str, _Sender] = {}  # by name; who was heard last stands last
        self._flooding: set[str] = set()
        self._closed = False
        self._changed = threading.Condition()  # guards all of these: each connection of Zenoh has a thread of its own

    def take(self, sample: Any) -> None:
        """A packet from Zenoh; what is none, or of another sensor than its key says, is dropped and counted."""
        key = str(sample.key_expr)
        name = key.removeprefix(f"{self._site}/").removesuffix("/frames")
        sound = is_sensor(name) and key == self._key(name)  # a key that somebody publishes under may have wildcards
        with self._changed:
            self._counts.add("frames", self._forward(name, sample.payload) if sound else "refused")

    def hear(self, subscribe: Callable[[str], Any]) -> None:
        """Have `take` called, and keep floods away, until it is closed; `subscribe` declares a key's subscriber."""

        def subscribed(name: str) -> Any:
            return subscribe(self._key(name))

        while not self._closed:
            everybody = subscribed("*")
            self._wait(set())
            time.sleep(LOOK_S)
            everybody.undeclare()
            with self._changed:
                flooding = self._flooding.copy()
                sound = self._senders.keys() - flooding
            apart = {name: subscribed(name) for name in sound}
            end = time.monotonic() + APART_S
            while self._wait(flooding, end - time.monotonic()):
                with self._changed:
                    flooding = self._flooding.copy()
                for name in flooding & apart.keys():
                    apart.pop(name).undeclare()
            for each in apart.values():
                each.undeclare()
            with self._changed:
                self._flooding.clear()

    def close(self) -> None:
        """Let `hear` end."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _key(self, name: str) -> str:
        return f"{self._site}/{name}/frames"

    def _wait(self, flooding: set[str], seconds: float | None = None) -> bool:
        """Wait until others than these flood; False where it is closed or the time is over before that."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._flooding != flooding, seconds)
            return not self._closed and self._flooding != flooding

    def _forward(self, name: str, payload: Any) -> str:
        """Send a packet on; returns what became of it."""
        try:
            sender = self._sender(name)
        except GesturedError:  # the network is down
            return "unheard"
        if sender is None:
            return "overflow"
        if sender.floods(self._clock()):
            self._flooding.add(name)
            self._changed.notify_all()
            return "flood"
        packet = payload.to_bytes()
        try:
            if not all(message.address.startswith(f"/{name}/") for message in decode(packet)):
                return "refused"
        except ProtocolError:
            return "refused"
        try:
            return "unheard" if sent_after_refusal(sender.socket, packet) else "sent"
        except OSError:  # the network is down, or a packet is too long for it
            return "unheard"

    def _sender(self, name: str) -> _Sender | None:
        """Who sends under a name; None where all places are taken by others."""
        now = self._clock()
        sender = self._senders.pop(name, None)
        if sender is None:
            if len(self._senders) >= MOST_SENDERS:
                longest = next(iter(self._senders))
                if self._senders[longest].due > now - SILENT_S:
                    return None
                self._senders.pop(longest).socket.close()
            sender = _Sender(connected(self._to), now)
        self._senders[name] = sender
        return sender
