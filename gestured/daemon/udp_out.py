"""A UDP socket to one destination that the configuration names: it never blocks, and counts what it cannot deliver."""

import socket

from gestured.core.address import Address
from gestured.daemon.log import Throttle, log
from gestured.daemon.metrics import Metrics
from gestured.daemon.sockets import resolve


class UdpOut:
    """One destination, and python-osc to write what it is sent.

    The socket is connected, so that a port where nobody listens is told to us (by the next call). A
    destination that cannot be reached costs a failed system call a packet, nothing more.
    """

    foresees = False  # whether it wants provisional events
    follows = False  # whether it wants touch events

    def __init__(self, destination: Address, metrics: Metrics) -> None:
        from gestured.client import osc_out  # python-osc: a daemon that publishes nothing does not load it

        self._out = osc_out
        self.destination = destination
        self._metrics, self._throttle = metrics, Throttle()
        self._socket: socket.socket | None = None
        self._connected = False
        try:
            family, self._where = resolve(destination, socket.SOCK_DGRAM)  # once: a look-up may block for seconds
            self._socket = socket.socket(family, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        except OSError as error:
            log.error("publish: no such destination", destination=str(destination), error=error.strerror)

    def close(self) -> None:
        """Close the socket; nothing is sent after it."""
        if self._socket is not None:
            self._socket.close()

    def send(self, packet: bytes) -> None:
        """Send a packet, or count that it could not be sent."""
        if self._socket is None:
            self._failed("unresolved")
            return
        for _ in range(2):
            try:
                if not self._connected:
                    self._socket.connect(self._where)
                    self._connected = True
                self._socket.send(packet)
                self._metrics.sent.add("sent")
                return
            except ConnectionRefusedError:
                self._failed("refused")  # the refusal of an earlier packet: this one was not sent yet
            except BlockingIOError:
                self._failed("full")
                return
            except OSError:
                self._connected = False  # our own address may have changed with the network
                self._failed("unreachable")
                return

    def _failed(self, result: str) -> None:
        self._metrics.sent.add(result)
        self._throttle.warn("event not delivered", result, destination=str(self.destination))
