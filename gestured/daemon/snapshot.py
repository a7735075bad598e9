"""How the daemon is at a moment: one frozen value, for everybody who shows, answers or counts it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gestured.core.beside.reading import SILENT, Reading
from gestured.daemon.settings import Settings
from gestured.daemon.shift import Shift
from gestured.model.ladder import Ladder

HANG_S = 2.0  # the loop counts as hanging after so long without a beat


@dataclass(frozen=True, slots=True)
class Models:
    """The model that answers, its place on the ladder, and its shift."""

    active: str  # the rung that answers
    asked: str  # the rung that the configuration names
    rung: int  # how far down the ladder `active` stands; 0 is the best
    degraded: bool
    failures: int
    file: str
    version: str
    sha256: str
    grid: tuple[int, int]  # rows and columns of its input
    failed: bool  # whether no model could answer the last segment
    shift_count: int  # gestures that the shift was measured on
    shift: Mapping[str, float]  # by quantity: share of gestures outside of what the model was trained on
    unlike: tuple[str, ...]  # quantities of which that share is too large

    @classmethod
    def of(cls, ladder: Ladder, shift: Shift, failed: bool) -> "Models":
        """What is known of a ladder's models now."""
        model = ladder.model
        return cls(
            ladder.active, ladder.name, ladder.rung, ladder.degraded, ladder.failures, ladder.source,
            model.metadata.version, model.sha256, (model.rows, model.columns), failed,
            shift.count, shift.shares(), tuple(shift.unlike()),
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything about the daemon at one moment; durations in seconds."""

    instance: str  # changes at every start
    time: float  # s since the Unix epoch
    now: float  # s, monotonic
    started: float  # s since the Unix epoch
    uptime_s: float
    stopping: bool
    loop_age_s: float  # since the loop last came round
    loop_lag_s: float  # how late the loop is
    models: Models
    gestures: tuple[str, ...]  # of the model's, in use
    own: Mapping[str, Any]  # the user's own; see `OwnGestures.report`
    sensors: Mapping[str, Reading]
    listening: Mapping[str, Mapping[str, Any]]  # `messages.listening`
    gates: tuple[str, ...]  # that are closed for each sensor that comes
    overdue: Mapping[str, float]  # by gate: for how many s the bridge that closed it has owed a sign of life
    recent: tuple[Mapping[str, Any], ...]  # the last answers
    clients: int  # of the event socket
    backlog_bytes: int  # that wait for slow clients
    kernel_drops: int  # packets for which the kernel had no room
    taps: int
    flight_limit_bytes: int
    flight_held_bytes: int
    addresses: Mapping[str, str | None]  # by kind of socket: where the daemon can be reached
    settings: Settings
    awaiting_restart: list[str]  # keys of settings that a reload has read, and only a restart puts to use

    @property
    def every_gesture(self) -> tuple[str, ...]:
        """The model's gestures in use, and the user's own."""
        return (*self.gestures, *self.own["gestures"])

    @property
    def states(self) -> dict[str, str]:
        """The state of each sensor."""
        return {name: reading.state for name, reading in self.sensors.items()}

    @property
    def state(self) -> str:
        """One of "ok", "degraded" and "no_data"."""
        return overall(self.states, impaired=self.models.degraded or self.models.failed)

    @property
    def hangs(self) -> bool:
        """Whether the loop does not turn."""
        return self.loop_age_s >= HANG_S

    def healthz(self) -> tuple[int, dict[str, object]]:
        """HTTP status and body: whether the loop turns."""
        return 503 if self.hangs else 200, {"healthy": not self.hangs, "loop_age_s": round(self.loop_age_s, 3)}

    def readyz(self) -> tuple[int, dict[str, object]]:
        """HTTP status and body: whether frames that come now would be answered, and why not."""
        reasons = [
            reason
            for failed, reason in (
                (self.hangs, "the event loop hangs"),
                (self.stopping, "the daemon is stopping"),
                (self.models.failed, "no model could classify the last segment"),
            )
            if failed
        ]
        return 503 if reasons else 200, {
            "ready": not reasons,
            "reason": "; ".join(reasons) or None,
            "state": self.state,
            "loop_lag_s": round(self.loop_lag_s, 3),
            "shift": list(self.models.unlike),
            "model": self.models.active,
            "degraded": self.models.degraded,
            "sensors": self.states,
        }


def overall(states: Mapping[str, str], *, impaired: bool) -> str:
    """The daemon's state by those of its sensors; `impaired`: the model that should answer does not."""
    if all(state in SILENT for state in states.values()):
        return "no_data"
    return "degraded" if impaired else "ok"
