"""The sinks of events. A sink takes every event, never blocks, and counts what it cannot deliver."""

import math
import signal
import socket
import threading
import time
from typing import Any, Protocol

from gestured.client.address import look_up
from gestured.core.address import Address
from gestured.core.beside.reading import SILENT
from gestured.core.events import Cancelled, Event, Gesture, Provisional, Status, Unknown
from gestured.daemon.log import Throttle
from gestured.daemon.metrics import Metrics
from gestured.daemon.sockets import reason_of

LOOK_UP_S = 5.0  # between two look-ups of a destination that was not found or not reached
START_S = 0.5  # how long the daemon's start or reload waits for a look-up, which goes on after it


class Sink(Protocol):
    """Takes every event; `epoch` is what to add to an event's times to get seconds since the Unix epoch.

    `test`: the event was made up by an operator, which the sink must tell its receivers.
    """

    def publish(self, event: Event, epoch: float, *, test: bool = False) -> None:
        """Deliver or count; never block, never raise."""
        ...


class UdpOut(Sink):
    """A sink that the configuration names, at one UDP address: it never blocks, and counts what it cannot deliver.

    A reload replaces it. The socket is connected, so that the next call tells us of a port without a listener. A
    destination that cannot be reached costs some failed system calls for each packet, and nothing more.
    """

    wants: frozenset[str] = frozenset()  # the types it takes of events that are made only on demand

    def __init__(self, destination: Address, metrics: Metrics) -> None:
        from gestured.client import osc_out  # python-osc: a daemon that publishes nothing does not load it

        self._out = osc_out
        self.destination = destination
        self._metrics, self._throttle = metrics, Throttle()
        self._found: tuple[int, Any] | None = None  # family and address to which no socket is connected yet
        self._socket: socket.socket | None = None
        self._begin().join(START_S)

    def _begin(self) -> threading.Thread:
        """Look up the destination in a thread, as a name server that does not answer takes many seconds."""
        self._due = math.inf
        thread = threading.Thread(target=self._look_up, name="publish", daemon=True)
        thread.start()
        return thread

    def _look_up(self) -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())  # signals are for the loop's thread
        try:
            self._found = look_up(self.destination, socket.SOCK_DGRAM)
        except OSError as error:
            reason = error.strerror or reason_of(error)
            self._throttle.warn("publish: no such destination", reason, destination=str(self.destination))
        self._due = time.monotonic() + LOOK_UP_S

    def take_over(self, before: "UdpOut") -> None:
        """Take over the state of a sink that a reload replaces, if that has the same destination.

        Its socket is used until the destination is looked up.
        """
        if before._socket is not None and before.destination == self.destination:
            self._socket = before._socket.dup()

    def close(self) -> None:
        """Close the socket; nothing is sent after it."""
        if self._socket is not None:
            self._socket.close()

    def send(self, packet: bytes) -> None:
        """Send a packet, or count that it could not be sent."""
        for _ in range(2):
            try:
                if self._found is not None:
                    self._connect(*self._found)
                if self._socket is None:
                    self._lost("unresolved")  # the network or its name server may come up later
                    return
                self._socket.send(packet)
                self._metrics.sent.add("sent")
                return
            except ConnectionRefusedError:
                self._failed("refused")  # the refusal of an earlier packet: this one was not sent yet
            except BlockingIOError:
                self._failed("full")
                return
            except OSError:
                self._lost("unreachable")  # after a change of network, our address or the destination's may be new
                return

    def _connect(self, family: int, where: Any) -> None:
        """Connect a new socket, since an old one keeps our address of its first connection even if connected again."""
        if self._socket is not None:
            self._socket.close()
        self._socket = socket.socket(family, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._socket.connect(where)
        self._found = None

    def _lost(self, result: str) -> None:
        """Count a packet that cannot be sent, and look the destination up again, at most every LOOK_UP_S."""
        self._failed(result)
        if time.monotonic() >= self._due:
            self._begin()

    def _failed(self, result: str) -> None:
        self._metrics.sent.add(result)
        self._throttle.warn("event not delivered", result, destination=str(self.destination))


class OscSink(UdpOut):
    """OSC over UDP to one destination: gestures and the status; their times are seconds since the Unix epoch.

    With `provisional` it also sends provisional events, and which of them are revoked.
    """

    def __init__(self, destination: Address, metrics: Metrics, *, provisional: bool = False) -> None:
        super().__init__(destination, metrics)
        self.wants = frozenset({"provisional"} if provisional else ())
        self._said: dict[str, Provisional] = {}  # by sensor: the provisional event that was sent, until its answer

    def publish(self, event: Event, epoch: float, *, test: bool = False) -> None:
        """Send a gesture with its place, the status and, if asked for, a provisional event; other events are not sent.

        The messages of a test stand in a bundle, after `/gestured/test ,s sensor`; their arguments are the usual ones.
        """
        message = self._out.message
        if isinstance(event, Status):
            heard = sum(state not in SILENT for state in event.sensors.values())
            self.send(message("/gestured/status", "si", (event.state, heard)).dgram)
            return
        if isinstance(event, Gesture | Unknown | Cancelled):
            self._judge(event)
        told = []
        if isinstance(event, Provisional) and self.wants:
            self._said[event.sensor] = event
            said = (event.gesture, event.confidence, event.id)
            told.append(message(f"/gestured/{event.sensor}/provisional", "sfi", said))
        elif isinstance(event, Gesture):
            args = (event.gesture, event.confidence, event.sequence, event.onset + epoch, event.offset + epoch)
            told.append(message(f"/gestured/{event.sensor}/gesture", "sfidd", args))
            if (at := event.where) is not None:
                place = (event.sequence, at.start.x, at.start.y, at.end.x, at.end.y, at.way, at.pressure, at.contacts)
                told.append(message(f"/gestured/{event.sensor}/where", "iffffffi", place))
        if test and told:
            mark = message("/gestured/test", "s", (event.sensor,))
            self.send(self._out.bundle(mark, *told).dgram)
        else:
            for one in told:
                self.send(one.dgram)

    def take_over(self, before: UdpOut) -> None:
        """Take over the provisional events that the sink before has sent, to revoke them if they turn out wrong."""
        super().take_over(before)
        if isinstance(before, OscSink) and before.destination == self.destination and self.wants:
            self._said, before._said = before._said, {}

    def close(self) -> None:
        """Revoke the provisional events whose answers will not be sent, then close the socket."""
        for said in self._said.values():
            self._revoke(said)
        super().close()

    def _revoke(self, said: Provisional) -> None:
        self.send(self._out.message(f"/gestured/{said.sensor}/revoked", "si", (said.gesture, said.id)).dgram)

    def _judge(self, answer: Gesture | Unknown | Cancelled) -> None:
        """Revoke the provisional event of a contact if its answer does."""
        said = self._said.get(answer.sensor)
        if said is not None and said.id == answer.id:
            del self._said[answer.sensor]
            if answer.provisional == "revoked":
                self._revoke(said)
