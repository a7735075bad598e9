"""Frames that come over Zenoh, sent on to the daemon's UDP port.

If more packets come than the connection carries, Zenoh drops packets of every sender. So a sender that floods its key
would silence all others. During a flood the bridge subscribes to the key of each other known sender instead of to a
wildcard, so that the routers do not send the flood.
"""

import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gestured.bridge.counts import Counts
from gestured.client.address import NUMERIC
from gestured.client.sensor import connected, sent_after_refusal
from gestured.core.address import Address, is_sensor
from gestured.core.errors import GesturedError, ProtocolError
from gestured.core.osc import decode

MOST_SENDERS = 512  # each has a socket of its own, since the daemon shares its time among sources
SILENT_S = 60.0  # a sender that is silent for so long gives its place to another, as in the daemon
MOST_HZ = 2000.0  # packets a second of one sender: twice as many as the fastest sensor sends
BURST_S = 1.0  # a sender may be so far ahead of MOST_HZ, since packets that were held up come at once
APART_S = 20.0  # a flood is kept away for so long; meanwhile unknown senders are not heard
LOOK_S = 0.25  # after that, all senders are heard for so long at least, so that new ones become known


@dataclass(slots=True)
class _Sender:
    """A sensor that sends over Zenoh."""

    socket: socket.socket
    due: float  # monotonic s, when the next packet would come at MOST_HZ

    def floods(self, now: float) -> bool:
        """Whether a packet at `now` s is one too many; if not, it is counted."""
        if self.due > now + BURST_S:
            return True
        self.due = max(self.due, now) + 1.0 / MOST_HZ
        return False


class Forward:
    """Sends packets from Zenoh to the daemon unchanged, so that their counter and time stay."""

    def __init__(self, site: str, to: Address, counts: Counts, clock: Callable[[], float] = time.monotonic) -> None:
        """`site` is the beginning of all keys, gestured/SITE. Raises GesturedError if `to` cannot be looked up."""
        self._site, self._counts, self._clock = site, counts, clock
        with connected(to) as found:  # a name is looked up once
            host, port = socket.getnameinfo(found.getpeername(), NUMERIC)
        self._to = Address(host, int(port))
        self._senders: dict[str, _Sender] = {}  # by name; the one heard last is at the end
        self._flooding: set[str] = set()
        self._closed = False
        self._changed = threading.Condition()  # guards the fields above, since each connection of Zenoh has a thread

    def take(self, sample: Any) -> None:
        """Send a packet on. One that is not OSC, or of another sensor than its key names, is dropped and counted."""
        key = str(sample.key_expr)
        name = key.removeprefix(f"{self._site}/").removesuffix("/frames")
        sound = is_sensor(name) and key == self._key(name)  # a sender may publish under a key with wildcards
        with self._changed:
            self._counts.add("frames", self._forward(name, sample.payload) if sound else "refused")

    def hear(self, subscribe: Callable[[str], Any]) -> None:
        """Subscribe to senders, and keep floods away, until `close`; `subscribe(key)` makes Zenoh call `take`."""

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
        """Wait until the flooding senders are others than `flooding`; False if closed, or the time is over first."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._flooding != flooding, seconds)
            return not self._closed and self._flooding != flooding

    def _forward(self, name: str, payload: Any) -> str:
        """Send a packet on; returns the label under which it is counted."""
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
        """The sender of that name, made if it is new; None if all places are taken. Raises GesturedError."""
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
