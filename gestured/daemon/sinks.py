"""Where events go. A sink takes every event and never blocks; what it cannot deliver it counts."""

from typing import Protocol

from gestured.core.address import Address
from gestured.core.beside.reading import SILENT
from gestured.core.events import Cancelled, Event, Gesture, Provisional, Status, Unknown
from gestured.daemon.metrics import Metrics
from gestured.daemon.settings import Settings
from gestured.daemon.tuio import TUIO, TuioSink
from gestured.daemon.udp_out import UdpOut


class Sink(Protocol):
    """Takes every event; `epoch` is what to add to an event's times to get seconds since the Unix epoch.

    `test`: the event was made up by an operator, which the sink must tell its receivers.
    """

    def publish(self, event: Event, epoch: float, *, test: bool = False) -> None:
        """Deliver or count; never block, never raise."""
        ...


class Output(Sink, Protocol):
    """A sink that the configuration names; a reload replaces it."""

    foresees: bool  # whether it wants provisional events
    follows: bool  # whether it wants touch events

    def close(self) -> None:
        """Let go of what the output holds; no event comes after this."""
        ...


def outputs(settings: Settings, metrics: Metrics) -> list[Output]:
    """All outputs that a configuration names. It looks up names of hosts, which may take long."""
    return [
        TuioSink(one.address, metrics)
        if one.scheme == TUIO
        else OscSink(one.address, metrics, provisional=settings.publish_provisional)
        for one in settings.publish
    ]


class OscSink(UdpOut):
    """OSC over UDP to one destination: gestures and the status; their times are seconds since the Unix epoch.

    With `provisional` it also sends provisional events, and which of them are revoked.
    """

    def __init__(self, destination: Address, metrics: Metrics, *, provisional: bool = False) -> None:
        super().__init__(destination, metrics)
        self.foresees = provisional
        self._said: dict[str, Provisional] = {}  # by sensor: the provisional event that was sent, until its answer

    def publish(self, event: Event, epoch: float, *, test: bool = False) -> None:
        """Send a gesture and where it was, the status, or where asked for a provisional event; others do not travel.

        A test's messages stand in a bundle behind `/gestured/test ,s sensor`; their arguments are the usual ones.
        """
        if isinstance(event, Gesture | Unknown | Cancelled):
            self._judge(event)
        if isinstance(event, Provisional) and self.foresees:
            self._said[event.sensor] = event
            said = (event.gesture, event.confidence, event.id)
            self.send(self._out.message(f"/gestured/{event.sensor}/provisional", "sfi", said).dgram)
        elif isinstance(event, Gesture):
            args = (event.gesture, event.confidence, event.sequence, event.onset + epoch, event.offset + epoch)
            messages = [self._out.message(f"/gestured/{event.sensor}/gesture", "sfidd", args)]
            if (at := event.where) is not None:
                place = (event.sequence, at.start.x, at.start.y, at.end.x, at.end.y, at.way, at.pressure, at.contacts)
                messages.append(self._out.message(f"/gestured/{event.sensor}/where", "iffffffi", place))
            mark = self._out.message("/gestured/test", "s", (event.sensor,))
            for packet in [self._out.bundle(mark, *messages)] if test else messages:
                self.send(packet.dgram)
        elif isinstance(event, Status):
            heard = sum(state not in SILENT for state in event.sensors.values())
            self.send(self._out.message("/gestured/status", "si", (event.state, heard)).dgram)

    def _judge(self, answer: Gesture | Unknown | Cancelled) -> None:
        """Take back what was sent of a contact that turns out to be something else."""
        said = self._said.get(answer.sensor)
        if said is not None and said.id == answer.id:
            del self._said[answer.sensor]
            if answer.provisional == "revoked":
                args = (said.gesture, said.id)
                self.send(self._out.message(f"/gestured/{said.sensor}/revoked", "si", args).dgram)
