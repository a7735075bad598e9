"""Gates that are closed and opened while the daemon runs: verbs of the control socket, and of the bridges' own."""

import math
import time
from dataclasses import dataclass, field
from typing import Any

from gestured.core.address import is_sensor
from gestured.core.gates import MOST_GATES
from gestured.core.hub import Hub
from gestured.daemon.caller import Connection
from gestured.daemon.desk import Desk
from gestured.daemon.log import Throttle
from gestured.daemon.request import Parameter, Refusal, Reply, Verb

LOGGED = 8  # log lines of one bridge in log.PERIOD_S; further ones are counted
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
    """Closes and opens gates of a hub's sensors, for operators."""

    def __init__(self, hub: Hub, desk: Desk) -> None:
        self._hub, self._desk = hub, desk
        self.owed: dict[tuple[str, str | None], float] = {}  # gate, sensor: monotonic s of a bridge's next sign of life

    def verbs(self) -> dict[str, Verb]:
        """Name -> verb."""
        return {
            "inhibit": Verb(self.inhibit, {"gate": GATE, "sensor": SENSOR, "seconds": SECONDS}),
            "allow": Verb(self.allow, {"gate": GATE, "sensor": SENSOR}),
        }

    def overdue(self, now: float) -> dict[str, float]:
        """By gate that a bridge has closed: for how many s it has owed a sign of life. The gate stays closed."""
        return {gate: now - due for (gate, _), due in tuple(self.owed.items()) if now > due}

    async def inhibit(
        self, connection: Connection, gate: str, sensor: str | None = None, seconds: float | None = None
    ) -> Reply:
        """Close a gate for a sensor, or for all and all that come; it opens by itself only where seconds are named."""
        self._check(sensor)
        named = self._hub.gates.named
        if gate not in named and len(named) >= MOST_GATES:
            raise Refusal(f"{MOST_GATES} gates are closed already, which is the most there can be; allow one first")
        self._desk.take(self._hub.inhibit(sensor, gate, time.monotonic(), math.inf if seconds is None else seconds))
        return self._closed(gate, sensor)

    async def allow(self, connection: Connection, gate: str, sensor: str | None = None) -> Reply:
        """Open a gate for a sensor, or for all; one that is open stays so."""
        self._check(sensor)
        self._desk.take(self._hub.allow(sensor, gate, time.monotonic()))
        self.owed = {
            which: due for which, due in self.owed.items() if which[0] != gate or sensor not in (None, which[1])
        }
        return self._closed(gate, sensor)

    def _check(self, sensor: str | None) -> None:
        known = self._hub.readings(time.monotonic())
        if sensor is not None and sensor not in known:
            expected = ", ".join(known) or "none: no sensor was heard, or is configured"
            raise Refusal(f"no sensor {sensor!r}, expected one of {expected}")

    def _closed(self, gate: str, sensor: str | None) -> Reply:
        """What is closed now, of the sensors that were meant."""
        names = self._hub.readings(time.monotonic()) if sensor is None else [sensor]
        return {"gate": gate, "sensors": {name: sorted(self._hub.gates.of(name)) for name in names}}


@dataclass
class Bridges:
    """The same for bridges, which close and open gates in their own name alone.

    A name belongs to the account that was the first to use it.
    """

    gates: Gatekeeper
    accounts: dict[str, int] = field(default_factory=dict)  # by name of a bridge
    _throttle: Throttle = field(default_factory=lambda: Throttle(burst=LOGGED))

    def verbs(self) -> dict[str, Verb]:
        """Name -> verb: all that the bridges' socket can do. Its log has what changes, and no signs of life."""
        named = {"bridge": BRIDGE, "gate": GATE, "sensor": SENSOR}
        return {
            "inhibit": Verb(self.inhibit, named | {"seconds": ALIVE}, changes=False),
            "allow": Verb(self.allow, named, changes=False),
        }

    async def inhibit(self, connection: Connection, bridge: str, seconds: float, **which: Any) -> Reply:
        """Close a gate until it is allowed. Within `seconds` the bridge says so again, else it counts as gone."""
        self._check(connection, bridge, which["gate"])
        reply = await self.gates.inhibit(connection, **which)
        owed = (which["gate"], which.get("sensor"))
        if owed not in self.gates.owed:
            self._log("gate closed by a bridge", connection, bridge, which)
        self.gates.owed[owed] = time.monotonic() + seconds
        return reply

    async def allow(self, connection: Connection, bridge: str, **which: Any) -> Reply:
        """Open a gate."""
        self._check(connection, bridge, which["gate"])
        self._log("gate opened by a bridge", connection, bridge, which)
        return await self.gates.allow(connection, **which)

    def _check(self, connection: Connection, bridge: str, gate: str) -> None:
        """Raises Refusal where a gate is not of that bridge's name, or the name is another account's."""
        if gate != bridge and not gate.startswith(f"{bridge}-"):
            raise Refusal(f"gate {gate!r} is not {bridge}'s own, expected {bridge}, or {bridge}- and more")
        if bridge not in self.accounts and len(self.accounts) >= MOST_GATES:
            raise Refusal(f"{MOST_GATES} bridges have used this socket already, which is the most there can be")
        uid = self.accounts.setdefault(bridge, connection.who.uid)
        if uid != connection.who.uid:
            raise Refusal(f"{bridge!r} is the name of uid {uid}, which has used it first, not of {connection.who.uid}")

    def _log(self, words: str, connection: Connection, bridge: str, which: dict[str, Any]) -> None:
        who = {"bridge": bridge, "uid": connection.who.uid, "pid": connection.who.pid}
        self._throttle.info(words, bridge, gate=which["gate"], sensor=which.get("sensor") or "all", **who)
