"""The parts of a running daemon, for the modules that use several of them."""

import secrets
import time
from dataclasses import dataclass, field
from typing import Any

from gestured.core.beside.reading import Reading
from gestured.core.events import Gate
from gestured.core.hub import Hub
from gestured.daemon.asked import Asked
from gestured.daemon.bound import Bound
from gestured.daemon.clients import EventServer
from gestured.daemon.desk import Desk
from gestured.daemon.gatekeeper import Gatekeeper
from gestured.daemon.health import Pulse
from gestured.daemon.metrics import Metrics
from gestured.daemon.own import OwnGestures
from gestured.daemon.settings import TITLES, Settings
from gestured.daemon.tap import Taps
from gestured.daemon.udp import Receiver
from gestured.daemon.views import Views
from gestured.model.ladder import Ladder

# Settings that a reload cannot change.
AT_A_RESTART = ("listen", "socket", "control", "gates", "gate", "metrics", "flight_recorder")


@dataclass
class Parts:
    """The parts of one daemon. A reload replaces `asked`; any thread may read."""

    asked: Asked  # the configuration in use, and what was opened for it
    bound: Bound
    metrics: Metrics
    hub: Hub
    own: OwnGestures
    desk: Desk
    clients: EventServer
    taps: Taps
    views: Views
    receiver: Receiver
    gates: Gatekeeper
    pulse: Pulse = field(default_factory=Pulse)
    instance: str = field(default_factory=lambda: secrets.token_hex(8))  # changes at every start
    started: float = field(default_factory=time.time)  # s since the Unix epoch
    begun: float = field(default_factory=time.monotonic)  # s, monotonic
    stopping: bool = False

    def __post_init__(self) -> None:
        self._started_with = self.settings

    @property
    def settings(self) -> Settings:
        """The configuration in use."""
        return self.asked.settings

    @property
    def ladder(self) -> Ladder:
        """The models in use."""
        return self.asked.ladder

    @property
    def impaired(self) -> bool:
        """Whether the model that should answer does not."""
        return self.ladder.degraded or self.desk.models_failed

    @property
    def gestures(self) -> tuple[str, ...]:
        """The gestures that a client may receive: those of the model's that are in use, and the user's own."""
        return (*self.hub.scene.gestures, *self.own.gestures)

    @property
    def as_of(self) -> float:
        """The time for which states hold, in monotonic s: now, or earlier if packets wait, as their sensors still send.

        `Receiver.served`, by which things are decided, may lie further back: packets may have come since the last read.
        """
        return time.monotonic() - self.receiver.behind_s

    @property
    def late_s(self) -> float:
        """How late the daemon is, in s: its loop, or the packets that it serves if too many come."""
        return max(self.pulse.lag_s, self.receiver.behind_s)

    def readings(self) -> dict[str, Reading]:
        """The reading of each sensor, heard or in the configuration."""
        return self.hub.readings(self.as_of)

    def listening(self) -> dict[str, dict[str, Any]]:
        """By sensor that has closed gates or arming, their state; `until` is in s since the Unix epoch."""
        now = time.monotonic()
        epoch = time.time() - now
        return {gate.sensor: heeds(gate, epoch) for gate in self.hub.listening(now)}

    def awaiting_restart(self) -> list[str]:
        """Settings that a reload has read with another value, but that only a restart puts to use."""
        new, old = self.settings, self._started_with
        changed = [key for key in AT_A_RESTART if getattr(new, key) != getattr(old, key)]
        return list(dict.fromkeys(TITLES.get(key, key) for key in changed))


def heeds(gate: Gate | None, epoch: float) -> dict[str, Any]:
    """What a sensor heeds: its closed gates and arming; None has neither. `until` is in s since the Unix epoch."""
    if gate is None:
        return {"armed": None, "closed": (), "until": None}
    return {"armed": gate.armed, "closed": gate.closed, "until": None if gate.until is None else gate.until + epoch}
