"""Arming and gates: whether contacts count, since a gesture may have to arm a sensor, and gates may silence it.

A contact is judged by its onset, so it is silenced as a whole or not at all. Gates have names, so that several callers
do not undo each other's work: a sensor is silent while any of its gates is closed.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from gestured.core.events import Gate

DISARMED, INHIBITED = "disarmed", "inhibited"  # reasons of `Unknown`
MOST_GATES = 16  # the most names of gates that are closed at a time
LONGEST_S = 3600.0  # the longest that a sensor may stay armed without a gesture


@dataclass(frozen=True, slots=True)
class Arming:
    """The gesture that arms a sensor, and for how long. Raises ValueError, which names the field."""

    by: str
    seconds: float = 5.0  # the sensor stays armed for so long after the last gesture

    def __post_init__(self) -> None:
        if not 0 < self.seconds <= LONGEST_S:  # NaN fails this, too
            raise ValueError(f"arming.seconds: expected more than 0, at most {LONGEST_S:g}, found {self.seconds!r}")

    @classmethod
    def of(cls, told: Any) -> "Arming | None":
        """The arming of a setting, a mapping with `by` and perhaps `seconds`; None for None. Raises ValueError."""
        if told is None:
            return None
        if not isinstance(told, Mapping) or not told.keys() <= {"by", "seconds"} or not isinstance(told.get("by"), str):
            raise ValueError(f"arming: expected `by`, the name of a gesture, and perhaps `seconds`, found {told!r}")
        return cls(told["by"], float(told.get("seconds", cls("").seconds)))


class Listening:
    """The gates of one sensor, and whether it is armed. Times are seconds on the stream's clock."""

    def __init__(self, arming: Arming | None) -> None:
        self.arming = arming
        self.armed = False
        self.closed: Mapping[str, float] = {}  # by name of a gate: when it opens by itself, on the hub's clock
        self.silenced: tuple[str, ...] = ()  # the gates that are closed, or were closed last
        self._silent_until = -math.inf  # contacts that began until then are silent; infinite while a gate is closed
        self.armed_until = -math.inf  # contacts that began until then count

    def silences(self, onset: float) -> bool:
        """Whether a gate was closed during a contact that began then."""
        return onset <= self._silent_until

    def hears(self, onset: float) -> bool:
        """Whether a contact that began then may be any gesture, and not only the one that arms the sensor."""
        return not self.silences(onset) and (self.arming is None or onset <= self.armed_until)

    def refusal(self, onset: float, gesture: str | None) -> str | None:
        """Why a contact that began then must be unknown, though it was recognised as this gesture (None: as none)."""
        if self.silences(onset):
            return INHIBITED
        free = gesture is None or self.arming is None or gesture == self.arming.by
        return None if free or onset <= self.armed_until else DISARMED

    def heard(self, t: float) -> bool:
        """Begin the armed time anew, as a gesture was published at `t`. Returns whether a `Gate` event is due."""
        if self.arming is None:
            return False
        self.arm(t + self.arming.seconds)
        return True

    def arm(self, until: float) -> None:
        """Arm the sensor: any gesture counts whose contact begins until then."""
        self.armed, self.armed_until = True, until

    def lapse(self, t: float, onset: float | None) -> bool:
        """End the armed time if it has run out by `t`. Returns whether it has, so that a `Gate` event is due.

        `onset`: when the contact without an answer began, None if there is none. One that began in time still counts.
        """
        over = self.armed and t > self.armed_until and (onset is None or onset > self.armed_until)
        self.armed = self.armed and not over
        return over

    def gate(self, closed: Mapping[str, float], past: float) -> bool:
        """Close exactly these gates; contacts that began by `past` are silenced, too. Returns whether to tell of it."""
        if closed == self.closed:
            return False
        if closed:
            self._silent_until, self.silenced = math.inf, tuple(sorted(closed))
        elif self.closed:
            self._silent_until = past
        self.closed = closed
        return True

    def change(self, arming: Arming | None, *, another_clock: bool) -> bool:
        """Go on in another scene. Returns whether a `Gate` event is due."""
        if another_clock and not self.closed:
            self._silent_until = -math.inf
        if arming == self.arming and not another_clock:
            return False
        told = (self.arming is None, self.armed) != (arming is None, False)
        self.arming, self.armed, self.armed_until = arming, False, -math.inf
        return told

    def told(self, sensor: str, since: float, armed_until: float) -> Gate:
        """The `Gate` event that says what the sensor listens to; its times and `armed_until` are on the hub's clock."""
        armed = None if self.arming is None else self.armed
        until = min((*self.closed.values(), *([armed_until] if self.armed else [])), default=math.inf)
        return Gate(sensor, armed, tuple(sorted(self.closed)), until if until < math.inf else None, since)


class Gates:
    """The closed gates of all sensors, heard yet or not. Times are seconds on the hub's clock."""

    def __init__(self, start: Iterable[str] = ()) -> None:
        """`start`: the gates that are closed for all sensors from the beginning."""
        self._all: dict[str, float] = dict.fromkeys(start, math.inf)  # for sensors that are not in `_of`
        self._of: dict[str, dict[str, float]] = {}  # by sensor, by name of a closed gate: when it opens by itself
        self.due = math.inf  # when the next gate opens by itself

    def of(self, sensor: str | None) -> Mapping[str, float]:
        """By name of a closed gate: when it opens by itself; for a sensor, or (None) for each new one."""
        return (self._all if sensor is None else self._of.get(sensor, self._all)).copy()

    @property
    def named(self) -> set[str]:
        """The gates that are closed for any sensor."""
        return set(self._all).union(*self._of.values())

    def inhibit(self, sensor: str | None, gate: str, until: float) -> None:
        """Close a gate for a sensor, or (None) for all, even new ones."""
        for closed in self._told(sensor):
            closed[gate] = until
        self._look()

    def allow(self, sensor: str | None, gate: str) -> None:
        """Open a gate for a sensor or (None) for all; one that is open stays so."""
        for closed in self._told(sensor):
            closed.pop(gate, None)
        self._look()

    def lapse(self, now: float) -> None:
        """Open what opens by itself until now."""
        for closed in self._told(None):
            for gate in [gate for gate, until in closed.items() if until <= now]:
                del closed[gate]
        self._look()

    def put(self, sensor: str, closed: Iterable[str]) -> None:
        """Close exactly these gates for a sensor, until they are opened."""
        theirs = dict.fromkeys(closed, math.inf)
        if theirs != self._all:
            self._of[sensor] = theirs  # none of these opens by itself, so `due` need not be computed anew
        else:
            self._of.pop(sensor, None)

    def _told(self, sensor: str | None) -> list[dict[str, float]]:
        if sensor is None:
            return [self._all, *self._of.values()]
        return [self._of.setdefault(sensor, self._all.copy())]

    def _look(self) -> None:
        self._of = {sensor: closed for sensor, closed in self._of.items() if closed != self._all}
        self.due = min((until for closed in self._told(None) for until in closed.values()), default=math.inf)
