"""Gates that are closed and opened while the daemon runs: verbs of the control socket, and of the bridges' own."""

import math
import time
from collections.abc import Sequence

from gestured.core.address import is_sensor
from gestured.core.facts import Fact
from gestured.core.hub import Hub
from gestured.core.listening import MOST_GATES
from gestured.daemon.caller import Connection
from gestured.daemon.desk import Desk
from gestured.daemon.log import Throttle
from gestured.daemon.request import Parameter, Refusal, Reply, Verb

BRIDGES_GATES = MOST_GATES // 2  # gates that bridges may keep closed at a time, so that names are left for an operator
LOGGED = 8  # log lines of one bridge in log.PERIOD_S; further ones are counted
LONGEST_S = 1e9  # for which a gate may be closed; some thirty years
NAME = "name, 1 to 64 of A-Z a-z 0-9 _ -"
TIME = f"seconds, more than 0 and at most {LONGEST_S:g}"
SENSOR = Parameter((str, type(None)), f"a sensor's {NAME}", check=lambda name: name is None or is_sensor(name))
GATE = Parameter(str, f"a gate's {NAME}", required=True, check=is_sensor)
BRIDGE = Parameter(str, f"the bridge's {NAME}", required=True, check=is_sensor)
SECONDS = Parameter((int, float, type(None)), TIME, check=lambda s: s is None or 0 < s <= LONGEST_S)
ALIVE = Parameter((int, float), TIME, required=True, check=lambda s: 0 < s <= LONGEST_S)


class Gatekeeper:
    """Closes and opens gates of a hub's sensors."""

    def __init__(self, hub: Hub, desk: Desk) -> None:
        self._hub, self._desk, self._throttle = hub, desk, Throttle(burst=LOGGED)
        self._owed: dict[tuple[str, str | None], float] = {}  # gate, sensor: monotonic s of its bridge's sign of life

    def verbs(self) -> dict[str, Verb]:
        """Name -> verb, for operators."""
        which = {"gate": GATE, "sensor": SENSOR}
        return {"inhibit": Verb(self.inhibit, which | {"seconds": SECONDS}), "allow": Verb(self.allow, which)}

    def of_bridges(self) -> dict[str, Verb]:
        """Name -> verb, for bridges: all that they can do. Their signs of life are no changes, and not logged."""
        which = {"bridge": BRIDGE, "gate": GATE, "sensor": SENSOR}
        inhibit = Verb(self.inhibit, which | {"seconds": ALIVE}, changes=False)
        return {"inhibit": inhibit, "allow": Verb(self.allow, which, changes=False)}

    def overdue(self, now: float) -> dict[str, float]:
        """By gate that a bridge has closed, and that is closed still: for how many s it has owed a sign of life."""
        owed: dict[str, float] = {}
        for (gate, sensor), due in tuple(self._owed.items()):
            if now > due and gate in self._hub.gates.of(sensor):
                owed[gate] = max(owed.get(gate, 0.0), now - due)
        return owed

    async def inhibit(
        self,
        connection: Connection,
        gate: str,
        sensor: str | None = None,
        seconds: float | None = None,
        bridge: str | None = None,
    ) -> Reply:
        """Close a gate for a sensor, or for all and all that come; for some seconds, or until it is allowed.

        A bridge's gate stays closed. Within the seconds the bridge says the same again, else it counts as gone.
        """
        self._check(gate, sensor, bridge)
        named, now = self._hub.gates.named, time.monotonic()
        if gate not in named and len(named) >= MOST_GATES:
            raise Refusal(f"{MOST_GATES} gates are closed already, which is the most there can be; allow one first")
        if bridge is not None and gate not in named and len(named & {name for name, _ in self._owed}) >= BRIDGES_GATES:
            raise Refusal(f"bridges have closed {BRIDGES_GATES} gates already, the most that they can; allow one first")
        if bridge is not None and seconds is not None:
            self._owed[gate, sensor], seconds = now + seconds, None
        return self._done(self._hub.inhibit(sensor, gate, now, seconds or math.inf), gate, sensor, bridge)

    async def allow(
        self, connection: Connection, gate: str, sensor: str | None = None, bridge: str | None = None
    ) -> Reply:
        """Open a gate for a sensor, or for all; one that is open stays so."""
        self._check(gate, sensor, bridge)
        for owed in [(name, one) for name, one in self._owed if name == gate and sensor in (None, one)]:
            del self._owed[owed]
        return self._done(self._hub.allow(sensor, gate, time.monotonic()), gate, sensor, bridge)

    def _check(self, gate: str, sensor: str | None, bridge: str | None) -> None:
        """Raises Refusal for a sensor that is not known, and for a gate that is not that bridge's own."""
        if bridge is not None and gate != bridge and not gate.startswith(f"{bridge}-"):
            raise Refusal(f"gate {gate!r} is not {bridge}'s own, expected {bridge}, or {bridge}- and more")
        if sensor is not None and not self._hub.knows(sensor):
            known = self._hub.readings(time.monotonic())
            expected = ", ".join(known) or "none: no sensor was heard, or is configured"
            raise Refusal(f"no sensor {sensor!r}, expected one of {expected}")

    def _done(self, facts: Sequence[Fact], gate: str, sensor: str | None, bridge: str | None) -> Reply:
        """What is closed now, of the sensors that were meant."""
        self._desk.take(facts)
        names = self._hub.readings(time.monotonic()) if sensor is None else [sensor]
        closed = {name: sorted(self._hub.gates.of(name)) for name in names}
        if facts and bridge is not None:
            self._throttle.info("a bridge has changed what is closed", bridge, gate=gate, closed=closed)
        return {"gate": gate, "sensors": closed}
