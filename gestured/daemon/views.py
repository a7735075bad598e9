"""The views for clients that look on: pictures of sensors, events and the daemon's state, made once for all of them.

Nothing is made if nobody looks. A view is made soon after the frames that it shows have been answered, and is sent in
few writes, so that no client that acts on an event waits for it.
"""

import asyncio
import math
import time
from collections.abc import Callable, Collection, Sequence

from gestured.core.events import Event, Provisional, Status, Touch
from gestured.core.facts import Arrived, Fact
from gestured.core.hub import Hub
from gestured.core.messages import json_line, to_json
from gestured.daemon.request import Connection, Reply
from gestured.daemon.tap import SOON_S

VIEW_S = 1 / 30  # between two views of one sensor, since nobody sees more than 30 a second
UNREAD_BYTES = 32 << 10  # bytes that may wait for a connection; while more wait, it misses views


class Views:
    """The connections that look at sensors, and what is to be sent to them."""

    def __init__(self, hub: Hub, state: Callable[[], Reply], changed: Callable[[], None]) -> None:
        """`state` gives the daemon's state; `changed` is called when other sensors are looked at than before."""
        self._hub, self._state, self._changed = hub, state, changed
        # By connection: the sensors that it looks at, and whether it also wants their counts as they were sent.
        self._looks: dict[Connection, tuple[frozenset[str], bool]] = {}
        self._due: set[str] = set()  # sensors that are looked at and have sent frames since their last view
        self._said: list[tuple[Event, float, bool]] = []  # events that wait to be sent, as published
        self._state_due = False
        self._timer: asyncio.Handle | None = None
        self._shown = -math.inf  # s, when the last round of views began

    @property
    def sensors(self) -> frozenset[str]:
        """The sensors that somebody looks at."""
        return frozenset().union(*(sensors for sensors, _ in self._looks.values()))

    def follow(self, connection: Connection, sensors: Collection[str], *, raw: bool) -> None:
        """Stream to a connection: the state and the views of sensors as they are now, and then what is new."""
        connection.streams, connection.flush = True, self._tell_events
        self._looks[connection] = (frozenset(sensors), raw)
        self._forget_gone()
        self._changed()
        self._state_due = True
        self._expect(sensors)

    def see(self, facts: Sequence[Fact]) -> None:
        """Note which sensors have sent frames."""
        if self._looks:
            arrived = {name for fact in facts if isinstance(fact, Arrived) for name in fact.sensors}
            self._expect(self.sensors & arrived)

    def publish(self, event: Event, epoch: float, *, test: bool = False) -> None:
        """Take an event, as a sink, for all who look on. The status is left out, since the state says more."""
        if not isinstance(event, Status) and any(_hears(sensors, event) for sensors, _ in self._looks.values()):
            self._said.append((event, epoch, test))
            self._expect(())

    def tick(self) -> None:
        """Tell the state; call it once a second."""
        if self._looks:
            self._forget_gone()
            self._state_due = True
            self._expect(())

    def close(self) -> None:
        """Show nothing more, since the sockets that the state tells of are closed from now on."""
        self._looks.clear()
        if self._timer is not None:
            self._timer.cancel()

    def _expect(self, sensors: Collection[str]) -> None:
        self._due.update(sensors)
        if self._timer is None and (self._due or self._said or self._state_due):
            wait = max(SOON_S, self._shown + VIEW_S - time.monotonic())
            self._timer = asyncio.get_running_loop().call_later(wait, self._begin)

    def _begin(self) -> None:
        self._shown = time.monotonic()
        self._tell_events()
        self._go_on(sorted(self._due))

    def _go_on(self, sensors: list[str]) -> None:
        """Send one more view, or the state, to all who look; the next one has its turn after the frames that wait."""
        self._timer = None
        if sensors:
            self._show(sensors.pop())
        elif self._state_due:
            self._state_due = False
            self._send(json_line({"type": "state"} | self._state()), self._looks)
        if sensors or self._state_due:
            self._timer = asyncio.get_running_loop().call_soon(self._go_on, sensors)
        else:
            self._expect(())

    def _tell_events(self) -> None:
        """Send each connection the events that wait, in one write."""
        said, self._said = self._said, []
        lines = [(event, to_json(event, epoch, test=test)) for event, epoch, test in said]
        for connection, (sensors, _) in self._looks.items():
            heard = [line for event, line in lines if _hears(sensors, event)]
            if heard:
                connection.send(b"".join(heard), lines=len(heard))

    def _show(self, sensor: str) -> None:
        self._due.discard(sensor)
        for raw in (False, True):
            lookers = [one for one, (sensors, sent) in self._looks.items() if sensor in sensors and sent is raw]
            view = self._hub.view(sensor, time.monotonic(), raw=raw) if lookers else None
            if view is not None:
                self._send(json_line({"type": "view", **view, "time": time.time()}), lookers)

    def _send(self, line: bytes, connections: Collection[Connection]) -> None:
        """Send a view or a state; a connection that has not read the last ones misses it."""
        for connection in connections:
            if connection.unread <= UNREAD_BYTES:
                connection.send(line)

    def _forget_gone(self) -> None:
        before = self.sensors
        self._looks = {one: what for one, what in self._looks.items() if not one.closed}
        if self.sensors != before:
            self._changed()


def _hears(sensors: frozenset[str], event: Event) -> bool:
    """Whether a connection that looks at these sensors gets an event: guesses and fingers of others are left out."""
    return not isinstance(event, Provisional | Touch) or event.sensor in sensors
