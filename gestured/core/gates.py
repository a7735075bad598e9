"""The gates of a hub: which are closed for which sensors, also for those that were not heard yet.

A gate has a name, so that what one opens another keeps closed: a sensor is silent while any of its gates is closed.
Times are seconds on the hub's clock.
"""

import math
from collections.abc import Iterable, Mapping

MOST_GATES = 16  # names of gates that are closed at a time


class Gates:
    """Gates that are closed, by sensor."""

    def __init__(self, start: Iterable[str] = ()) -> None:
        """`start`: closed for all sensors from the beginning."""
        self._all: dict[str, float] = dict.fromkeys(start, math.inf)  # for sensors that were told nothing else
        self._of: dict[str, dict[str, float]] = {}  # by sensor, by name: when it opens by itself
        self.due = math.inf  # when the next one opens by itself

    def of(self, sensor: str | None) -> Mapping[str, float]:
        """What is closed for a sensor, or (None) for each that comes; by name when it opens by itself."""
        return (self._all if sensor is None else self._of.get(sensor, self._all)).copy()

    @property
    def named(self) -> set[str]:
        """The gates that are closed for any sensor."""
        return set(self._all).union(*self._of.values())

    def inhibit(self, sensor: str | None, gate: str, until: float) -> None:
        """Close a gate for a sensor, or (None) for all of them and all that come."""
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
        """Exactly these are closed for a sensor, until they are opened."""
        theirs = dict.fromkeys(closed, math.inf)
        if theirs != self._all:
            self._of[sensor] = theirs  # nothing of it opens by itself, so that `due` is not looked for among all others
        else:
            self._of.pop(sensor, None)

    def _told(self, sensor: str | None) -> list[dict[str, float]]:
        if sensor is None:
            return [self._all, *self._of.values()]
        return [self._of.setdefault(sensor, self._all.copy())]

    def _look(self) -> None:
        self._of = {sensor: closed for sensor, closed in self._of.items() if closed != self._all}
        self.due = min((until for closed in self._told(None) for until in closed.values()), default=math.inf)
