"""Gates that somebody closes and opens while the daemon runs: verbs of the control socket, and of the bridges' own."""

import time
from collections.abc import Mapping

from gestured.core.address import is_sensor
from gestured.core.facts import Fact
from gestured.core.gates import MOST_GATES
from gestured.core.hub import Hub
from gestured.daemon.caller import Connection
from gestured.daemon.desk import Desk
from gestured.daemon.request import Parameter, Refusal, Reply, Verb

LONGEST_S = 1e9  # for which a gate may be closed; some thirty years
NAME = "name, 1 to 64 of A-Z a-z 0-9 _ -"
SENSOR = Parameter((str, type(None)), f"a sensor's {NAME}", check=lambda name: name is None or is_sensor(name))
GATE = Parameter(str, f"a gate's {NAME}", required=True, check=is_sensor)
SECONDS = Parameter(
    (int, float, type(None)),
    f"seconds, more than 0 and at most {LONGEST_S:g}",
    check=lambda seconds: seconds is None or 0 < seconds <= LONGEST_S,
)


class Gatekeeper:
    """Closes and opens gates of a hub's sensors."""

    def __init__(self, hub: Hub, desk: Desk) -> None:
        self._hub, self._desk = hub, desk

    def verbs(self) -> dict[str, Verb]:
        """Name -> verb, for operators."""
        return {
            "inhibit": Verb(self.inhibit, {"gate": GATE, "sensor": SENSOR, "seconds": SECONDS}),
            "allow": Verb(self.allow, {"gate": GATE, "sensor": SENSOR}),
        }

    async def inhibit(
        self, connection: Connection, gate: str, sensor: str | None = None, seconds: float | None = None
    ) -> Reply:
        """Close a gate for a sensor, or for all and all that come; it opens by itself only where seconds are named."""
        self._check(sensor)
        named = self._hub.gates.named
        if gate not in named and len(named) >= MOST_GATES:
            raise Refusal(f"{MOST_GATES} gates are closed already, which is the most there can be; allow one first")
        now = time.monotonic()
        return self._done(gate, sensor, self._hub.inhibit(sensor, gate, now, *([] if seconds is None else [seconds])))

    async def allow(self, connection: Connection, gate: str, sensor: str | None = None) -> Reply:
        """Open a gate for a sensor, or for all; one that is open stays so."""
        self._check(sensor)
        return self._done(gate, sensor, self._hub.allow(sensor, gate, time.monotonic()))

    def _check(self, sensor: str | None) -> None:
        known = self._closed()
        if sensor is not None and sensor not in known:
            expected = ", ".join(known) or "none: no sensor was heard, or is configured"
            raise Refusal(f"no sensor {sensor!r}, expected one of {expected}")

    def _closed(self) -> Mapping[str, list[str]]:
        """By sensor that was heard or is configured, the gates that silence it."""
        return {name: sorted(self._hub.gates.of(name)) for name in self._hub.readings(time.monotonic())}

    def _done(self, gate: str, sensor: str | None, facts: list[Fact]) -> Reply:
        """What is closed now, of the sensors that were meant."""
        self._desk.take(facts)
        return {"gate": gate, "sensors": {n: gates for n, gates in self._closed().items() if sensor in (None, n)}}
