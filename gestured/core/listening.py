"""Whether what is felt on a sensor counts: a gesture may have to arm it, and gates may silence it.

Times are seconds on the stream's clock. A contact is judged by its onset, so that it is silent or not as a whole.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gestured.core.events import Gate

DISARMED, INHIBITED = "disarmed", "inhibited"  # reasons of `Unknown`
LONGEST_S = 3600.0  # that a sensor may stay armed without a gesture


@dataclass(frozen=True, slots=True)
class Arming:
    """The gesture that arms a sensor, and for how long. Raises ValueError, which names the field."""

    by: str
    seconds: float = 5.0  # since the last gesture

    def __post_init__(self) -> None:
        if not 0 < self.seconds <= LONGEST_S:  # so NaN is none
            raise ValueError(f"arming.seconds: expected more than 0, at most {LONGEST_S:g}, found {self.seconds!r}")

    @classmethod
    def of(cls, told: Any) -> "Arming | None":
        """What settings tell, as a mapping with `by` and perhaps `seconds`; None where they tell nothing."""
        if told is None:
            return None
        if not isinstance(told, Mapping) or not told.keys() <= {"by", "seconds"} or not isinstance(told.get("by"), str):
            raise ValueError(f"arming: expected `by`, the name of a gesture, and perhaps `seconds`, found {told!r}")
        return cls(told["by"], float(told.get("seconds", cls("").seconds)))


class Listening:
    """The gates of one sensor, and whether it is armed."""

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
        """Whether a contact that began then may be any gesture, and not only the one that arms."""
        return not self.silences(onset) and (self.arming is None or onset <= self.armed_until)

    def refusal(self, onset: float, gesture: str | None) -> str | None:
        """Why a contact that began then must be unknown, though it was recognised as this gesture (None: as none)."""
        if self.silences(onset):
            return INHIBITED
        free = gesture is None or self.arming is None or gesture == self.arming.by
        return None if free or onset <= self.armed_until else DISARMED

    def heard(self, t: float) -> bool:
        """A gesture was published at `t`, and begins the seconds anew. Returns whether there is something to tell."""
        if self.arming is None:
            return False
        self.arm(t + self.arming.seconds)
        return True

    def arm(self, until: float) -> None:
        """Every gesture counts of a contact that begins until then."""
        self.armed, self.armed_until = True, until

    def lapse(self, t: float, onset: float | None) -> bool:
        """Whether the seconds have run out by `t`, which is to be told. A contact that began before still counts.

        `onset` is when the contact began whose answer is open, None where there is none.
        """
        over = self.armed and t > self.armed_until and (onset is None or onset > self.armed_until)
        self.armed = self.armed and not over
        return over

    def gate(self, closed: Mapping[str, float], past: float) -> bool:
        """These gates are closed from now on; what began until `past` has begun before. Returns whether to tell it."""
        if closed == self.closed:
            return False
        if closed:
            self._silent_until, self.silenced = math.inf, tuple(sorted(closed))
        elif self.closed:
            self._silent_until = past
        self.closed = closed
        return True

    def change(self, arming: Arming | None, *, another_clock: bool) -> bool:
        """Go on in another scene. Returns whether there is something to tell."""
        if another_clock and not self.closed:
            self._silent_until = -math.inf
        if arming == self.arming and not another_clock:
            return False
        told = (self.arming is None, self.armed) != (arming is None, False)
        self.arming, self.armed, self.armed_until = arming, False, -math.inf
        return told

    def told(self, sensor: str, since: float, armed_until: float) -> Gate:
        """All of it as an event of that sensor; times are on the hub's clock, that until which it is armed, too."""
        armed = None if self.arming is None else self.armed
        until = min((*self.closed.values(), *([armed_until] if self.armed else [])), default=math.inf)
        return Gate(sensor, armed, tuple(sorted(self.closed)), until if until < math.inf else None, since)
