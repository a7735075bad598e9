"""The events that are published: frozen values in a plain union. Times are seconds on the stream's clock.

An `id` numbers a sensor's segments: each `Onset` is followed by exactly one `Gesture`, `Unknown` or `Cancelled`, and
by one `Release`. If somebody asks for them, at most one `Provisional` comes between onset and answer; the answer's
`provisional` says what became of it: "confirmed", "revoked", or None if there was none.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Onset:
    """A contact began."""

    sensor: str
    id: int
    onset: float  # s


@dataclass(frozen=True, slots=True)
class Provisional:
    """The most probable gesture of a contact that goes on. The answer comes later, and confirms or revokes it."""

    sensor: str
    id: int
    gesture: str
    confidence: float  # 0..1
    onset: float  # s
    decided: float  # s, when the model was sure enough


@dataclass(frozen=True, slots=True)
class Place:
    """A place on a sensor as a person in front of it sees it, in fractions of the sensor's sides."""

    x: float  # 0..1, from left to right
    y: float  # 0..1, upward


@dataclass(frozen=True, slots=True)
class Where:
    """Where a segment was, how far it went and how hard it pressed; for two fingers, the middle between them."""

    start: Place
    end: Place
    way: float  # length of the path in sides of the shorter edge; 0 if it stayed within the noise
    pressure: float  # counts of the strongest taxel above the idle sensor
    snr: float  # `pressure` over the noise
    contacts: int  # 1 or 2 fingers at the same time
    bridged: int  # bad taxels under the way
    zone: str | None = None  # the zone in which it began


@dataclass(frozen=True, slots=True)
class Gesture:
    """A segment was recognised."""

    sensor: str
    id: int
    gesture: str
    confidence: float  # 0..1, calibrated
    sequence: int  # counts a sensor's gestures from 1 without gaps
    onset: float  # s, first touched frame
    offset: float  # s, last touched frame
    decided: float  # s, when it was decided: the end of the wait after the last touched frame, or later
    frames: int  # touched frames, first to last
    lost: int  # frames that went missing between them
    model: str  # name of the model that answered
    degraded: bool  # whether a fallback answered
    scores: Mapping[str, float]  # by gesture, for the model's gestures that are in use
    provisional: str | None = None
    own: bool = False  # whether it is a gesture of the user's own
    where: Where | None = None  # None only if nothing is known of it


@dataclass(frozen=True, slots=True)
class Unknown:
    """A segment that is no gesture, of which the model is not sure enough, or that does not count now.

    `reason` is confidence (below the threshold), context (the same, but it would not be if nothing had gone before the
    contact or rested on the sensor), hole (frames were lost), rate (the sensor is too slow or too fast), disarmed (the
    gesture that arms the sensor did not come before) or inhibited (a gate is closed, or was).
    """

    sensor: str
    id: int
    confidence: float  # 0..1, of the best gesture; the following fields are those of `Gesture`
    onset: float
    offset: float
    decided: float
    frames: int
    lost: int
    model: str
    degraded: bool
    scores: Mapping[str, float]
    reason: str = "confidence"  # confidence, context, hole, rate, disarmed, inhibited
    provisional: str | None = None
    where: Where | None = None
    gates: tuple[str, ...] = ()  # names of the gates that silenced it


@dataclass(frozen=True, slots=True)
class Cancelled:
    """A contact without a gesture or unknown; `reason` says why."""

    sensor: str
    id: int
    reason: str  # held, silence, restart, glitch, stuck, refractory, model, internal_error
    provisional: str | None = None


@dataclass(frozen=True, slots=True)
class Release:
    """The sensor was let go. It follows each `Onset`, whatever the answer was."""

    sensor: str
    id: int
    offset: float  # s


@dataclass(frozen=True, slots=True)
class Gate:
    """What a sensor listens to has changed: it is armed now or no longer, or a gate was closed or opened."""

    sensor: str
    armed: bool | None  # None if no gesture arms it
    closed: tuple[str, ...]  # names of closed gates; while there is one, every contact is unknown
    until: float | None  # s, on the hub's clock: when the first of this changes by itself; None if nothing does
    since: float  # s, on the hub's clock, by which an operator acts


@dataclass(frozen=True, slots=True)
class Touch:
    """A finger of a contact that goes on. It is no answer: the answer follows, or has come already."""

    sensor: str
    id: int  # of the contact
    touch: int  # number of the finger, counted from 0 in each contact
    phase: str  # down, move, up; each `down` is followed by exactly one `up`
    t: float  # s, when the finger was seen there
    x: float  # 0..1, from left to right
    y: float  # 0..1, upward
    dx: float  # change of `x` since the last event of this finger
    dy: float  # change of `y`
    pressure: float  # counts of the strongest taxel above the idle sensor
    area: int  # taxels above half of `pressure`
    zone: str | None = None  # the zone in which it came down
    reason: str | None = None  # of an `up` though the finger is still there: learned


TouchEvent = Touch  # its public name, since `gestured.Touch` is a finger's position that a sensor reports


@dataclass(frozen=True, slots=True)
class Status:
    """The state of the daemon, once a second as a sign of life."""

    state: str  # "ok", "degraded", "no_data"
    sensors: Mapping[str, str]  # state of each sensor
    model: str
    time: float  # s since the Unix epoch
    gates: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # armed, closed, until of some sensors


Event = Onset | Provisional | Gesture | Unknown | Cancelled | Release | Touch | Gate | Status
ANSWERS = (Gesture, Unknown, Cancelled)  # for isinstance, which would build a union anew with each call
