"""Frames that come in over Zenoh, on their way to the daemon's UDP port."""

import socket
from typing import Any

from gestured.bridge.counts import Counts
from gestured.bridge.options import destination
from gestured.client.sensor import sent_after_refusal
from gestured.core.address import Address
from gestured.core.errors import ProtocolError
from gestured.core.osc import decode

MOST_SENDERS = 512  # sensors from Zenoh, each with a socket of its own: the daemon shares its work out by sources


class Forward:
    """Frames from Zenoh to the daemon, byte by byte as they came: their counter and time stay."""

    def __init__(self, to: Address, counts: Counts) -> None:
        """Raises BridgeError where `to` is no address."""
        self._family, self._address = destination(to)
        self._counts = counts
        self._senders: dict[str, socket.socket] = {}

    def take(self, sample: Any) -> None:
        """A packet from Zenoh; what is none, or of another sensor than its key says, is dropped and counted."""
        sensor, packet = str(sample.key_expr).split("/")[-2], sample.payload.to_bytes()  # gestured/SITE/SENSOR/frames
        try:
            fits = all(message.address.startswith(f"/{sensor}/") for message in decode(packet))
        except ProtocolError:
            fits = False
        if not fits:
            self._counts.add("frames", "refused")
            return
        if sensor not in self._senders and len(self._senders) >= MOST_SENDERS:
            self._counts.add("frames", "overflow")
            return
        try:
            refused = sent_after_refusal(self._sender(sensor), packet)
        except OSError:  # the network is down, or a packet is too long for it
            refused = True
        self._counts.add("frames", "unheard" if refused else "sent")

    def _sender(self, sensor: str) -> socket.socket:
        if sensor not in self._senders:
            sender = socket.socket(self._family, socket.SOCK_DGRAM)
            sender.connect(self._address)
            self._senders[sensor] = sender
        return self._senders[sensor]
