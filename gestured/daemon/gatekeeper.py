"""The gatekeeper: verbs that close and open gates, for the control socket and for the bridges' socket."""

import math
import time
from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from gestured.core.facts import Fact
from gestured.core.hub import Hub
from gestured.core.listening import MOST_GATES
from gestured.daemon.desk import Desk
from gestured.daemon.log import Throttle
from gestured.daemon.request import Connection, Refusal, Reply, Verb
from gestured.daemon.values import BridgeName, GateName, SensorName

BRIDGES_GATES = MOST_GATES // 2  # gates that bridges may keep closed at a time, so that names are left for an operator
LOGGED = 8  # log lines of one bridge in log.PERIOD_S; further ones are counted
LONGEST_S = 1e9  # the longest time for which a gate may be closed; some thirty years

Sensor = SensorName | None
Seconds = Annotated[float, Field(gt=0, le=LONGEST_S)]


class Gatekeeper:
    """Closes and opens gates of a hub's sensors."""

    def __init__(self, hub: Hub, desk: Desk) -> None:
        self._hub, self._desk, self._throttle = hub, desk, Throttle(burst=LOGGED)
        self._owed: dict[tuple[str, str | None], float] = {}  # by gate, sensor: monotonic s, when its bridge is overdue

    def verbs(self) -> dict[str, Verb]:
        """Name -> verb, for operators."""
        return {"inhibit": Verb(self.inhibit), "allow": Verb(self.allow)}

    def of_bridges(self) -> dict[str, Verb]:
        """Name -> verb, for bridges, which can do nothing else. They repeat these often, so no request is logged."""
        return {"inhibit": Verb(self.keep_closed, changes=False), "allow": Verb(self.open_again, changes=False)}

    def overdue(self, now: float) -> dict[str, float]:
        """By gate that is still closed by a bridge: for how many s this bridge is overdue, if it is."""
        owed: dict[str, float] = {}
        for (gate, sensor), due in tuple(self._owed.items()):
            if now > due and gate in self._hub.gates.of(sensor):
                owed[gate] = max(owed.get(gate, 0.0), now - due)
        return owed

    async def inhibit(
        self, connection: Connection, gate: GateName, sensor: Sensor = None, seconds: Seconds | None = None
    ) -> Reply:
        """Close a gate for one sensor, or for all present and future ones; for some seconds, or until it is allowed."""
        return self._close(gate, sensor, seconds or math.inf)

    async def allow(self, connection: Connection, gate: GateName, sensor: Sensor = None) -> Reply:
        """Open a gate for one sensor, or for all; a gate that is open stays open."""
        return self._open(gate, sensor)

    async def keep_closed(  # noqa: PLR0913 - the keys of a request
        self,
        connection: Connection,
        bridge: BridgeName,
        gate: GateName,
        seconds: Seconds,
        sensor: Sensor = None,
        *,
        renew: bool = False,
    ) -> Reply:
        """Close a bridge's gate until it is allowed; a bridge that does not renew this within `seconds` is overdue.

        With `renew` it changes no gate, which an operator may have opened or given a time meanwhile.
        """
        _require_own(gate, bridge)
        if renew:
            due = time.monotonic() + seconds
            self._owed |= {(name, one): due for name, one in self._owed if name == gate and sensor in (None, one)}
            return self._done([], gate, sensor, bridge)
        named, theirs = self._hub.gates.named, {name for name, _ in self._owed}
        if gate not in named and len(named & theirs) >= BRIDGES_GATES:
            raise Refusal(f"bridges have closed {BRIDGES_GATES} gates already, the most that they can; allow one first")
        reply = self._close(gate, sensor, math.inf, bridge)
        self._owed[gate, sensor] = time.monotonic() + seconds
        return reply

    async def open_again(
        self, connection: Connection, bridge: BridgeName, gate: GateName, sensor: Sensor = None
    ) -> Reply:
        """Open a bridge's gate."""
        _require_own(gate, bridge)
        return self._open(gate, sensor, bridge)

    def _close(self, gate: str, sensor: str | None, seconds: float, bridge: str = "") -> Reply:
        self._require_known(sensor)
        if gate not in self._hub.gates.named and len(self._hub.gates.named) >= MOST_GATES:
            raise Refusal(f"{MOST_GATES} gates are closed already, which is the most there can be; allow one first")
        return self._done(self._hub.inhibit(sensor, gate, time.monotonic(), seconds), gate, sensor, bridge)

    def _open(self, gate: str, sensor: str | None, bridge: str = "") -> Reply:
        self._require_known(sensor)
        for owed in [(name, one) for name, one in self._owed if name == gate and sensor in (None, one)]:
            del self._owed[owed]
        return self._done(self._hub.allow(sensor, gate, time.monotonic()), gate, sensor, bridge)

    def _require_known(self, sensor: str | None) -> None:
        """Raises Refusal for a sensor that was not heard and is not in the configuration."""
        if sensor is not None and not self._hub.knows(sensor):
            known = ", ".join(self._hub.states(time.monotonic()))
            raise Refusal(
                f"no sensor {sensor!r}, expected one of {known or 'none: no sensor was heard, or is configured'}"
            )

    def _done(self, facts: Sequence[Fact], gate: str, sensor: str | None, bridge: str) -> Reply:
        """Publish the facts of a change; the reply says which gates of the sensors in question are closed now."""
        self._desk.take(facts)
        names = self._hub.states(time.monotonic()) if sensor is None else [sensor]
        closed = {name: sorted(self._hub.gates.of(name)) for name in names}
        if facts and bridge:
            self._throttle.info("a bridge has changed what is closed", bridge, gate=gate, closed=closed)
        return {"gate": gate, "sensors": closed}


def _require_own(gate: str, bridge: str) -> None:
    """Raises Refusal for a gate that is not that bridge's own."""
    if gate != bridge and not gate.startswith(f"{bridge}-"):
        raise Refusal(f"gate {gate!r} is not {bridge}'s own, expected {bridge}, or {bridge}- and more")
