"""Sensors that somebody looks at: a view is made once for all who look, soon after its frame has been answered."""

import asyncio
import json
import math
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from gestured.core.facts import Arrived, Fact
from gestured.core.hub import Hub
from gestured.daemon.control import Connection
from gestured.daemon.request import Reply
from gestured.daemon.status import viewed

VIEW_S = 1 / 30  # between two views of one sensor: nobody sees more
SOON_S = 0.01  # after a frame: what came together with it is answered by then, and no eye sees the difference
VIEWS = 16  # sensors whose last view is kept for who asks again
UNREAD_BYTES = 32 << 10  # that a connection may still have to read: with more it misses views until it has read


@dataclass(frozen=True, slots=True)
class Look:
    """What one connection looks at."""

    sensors: frozenset[str]
    raw: bool  # counts as they were sent, too


class Views:
    """Views for those who ask, and for those who look on. Nothing is made where nobody looks."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._made: dict[tuple[str, bool], tuple[float, Reply | None]] = {}  # s, and the view
        self._looks: dict[Connection, Look] = {}
        self._due: set[str] = set()  # sensors that are looked at, with something new
        self._timer: asyncio.Handle | None = None
        self._shown = -math.inf  # s, when a round of views began

    def view(self, sensor: str, *, raw: bool) -> Reply | None:
        """A sensor as it is felt now, the same for who asks again within VIEW_S; None where it was not heard."""
        made, view = self._made.get((sensor, raw), (-math.inf, None))
        return view if time.monotonic() - made < VIEW_S else self._make(sensor, raw)

    def follow(self, connection: Connection, sensors: Collection[str], *, raw: bool) -> None:
        """Stream the views of these sensors to a connection: as they are now, and then whenever there is a frame."""
        connection.streams = True
        self._looks = {one: look for one, look in self._looks.items() if not one.closed}
        self._looks[connection] = Look(frozenset(sensors), raw)
        self._expect(sensors)

    def see(self, facts: Sequence[Fact]) -> None:
        """Take note of which sensors sent something."""
        if self._looks:
            arrived = {fact.sensor for fact in facts if isinstance(fact, Arrived)}
            self._expect({name for look in self._looks.values() for name in look.sensors & arrived})

    def _expect(self, sensors: Collection[str]) -> None:
        self._due.update(sensors)
        if self._due and self._timer is None:
            wait = max(SOON_S, self._shown + VIEW_S - time.monotonic())
            self._timer = asyncio.get_running_loop().call_later(wait, self._begin)

    def _begin(self) -> None:
        self._shown = time.monotonic()
        self._looks = {one: look for one, look in self._looks.items() if not one.closed}
        self._show(sorted(self._due))

    def _show(self, sensors: list[str]) -> None:
        """Show a sensor to all who look at it; the next one has its turn after the frames that wait."""
        self._timer = None
        sensor = sensors.pop()
        self._due.discard(sensor)
        for raw in (False, True):
            lookers = [one for one, look in self._looks.items() if sensor in look.sensors and look.raw is raw]
            view = self._make(sensor, raw) if lookers else None
            if view is not None:
                line = json.dumps({"type": "view"} | view, separators=(",", ":"), allow_nan=False).encode() + b"\n"
                for connection in lookers:
                    if connection.unread <= UNREAD_BYTES:
                        connection.send(line)
        if sensors:
            self._timer = asyncio.get_running_loop().call_soon(self._show, sensors)
        else:
            self._expect(())

    def _make(self, sensor: str, raw: bool) -> Reply | None:
        now = time.monotonic()
        found = self._hub.view(sensor, now, raw=raw)
        if found is None:
            return None
        if len(self._made) >= VIEWS:
            self._made.clear()
        view = viewed(sensor, *found) | {"time": time.time()}
        self._made[sensor, raw] = now, view
        return view
