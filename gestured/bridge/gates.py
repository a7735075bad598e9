"""A gate that a bus closes and opens: the bridge passes its commands to the daemon's socket for bridges.

Only the daemon stores for which sensors the gate is closed. Meanwhile the bridge tells it again and again that bridge
and bus are alive; if that ends, the gate stays closed, and the daemon reports it as overdue.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from gestured.bridge.counts import Counts
from gestured.client.control import Control
from gestured.client.lines import Refused
from gestured.core.errors import GesturedError

ON, OFF = "ON", "OFF"  # commands: open the gate of a sensor, so that it listens, or close it
ALIVE_S = 30.0  # the daemon is promised a sign of life within so long
RENEWED_S = 10.0  # from one sign of life to the next
ANSWER_S = 2.0  # the longest wait for the daemon, which answers in milliseconds


class Gate:
    """One gate, by its name, of all sensors of a daemon."""

    def __init__(self, path: Path, name: str, counts: Counts) -> None:
        """`path` is the daemon's socket for bridges."""
        self.name = name
        self._path, self._counts = path, counts
        self._said = ""  # why the last command failed, if it did
        self._due = 0.0  # monotonic s, the next sign of life

    def obey(self, sensor: str, command: str) -> list[str]:
        """Carry out a command; returns the gates of the sensor that are closed now. Raises GesturedError."""
        with self._asking(f"{sensor} {command}") as ask:
            answer = ask("inhibit", sensor=sensor, seconds=ALIVE_S) if command == OFF else ask("allow", sensor=sensor)
            closed = answer.get("sensors")
            closed = closed.get(sensor) if isinstance(closed, dict) else None
            if not isinstance(closed, list) or not all(isinstance(name, str) for name in closed):
                raise Refused(f"{self._path} does not say which gates are closed: it is not the daemon's --gates")
            return closed

    def renew(self) -> None:
        """Tell the daemon every RENEWED_S that bridge and bus are alive; this closes and opens nothing."""
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + RENEWED_S
            with suppress(GesturedError), self._asking("a sign of life") as ask:
                ask("inhibit", seconds=ALIVE_S, renew=True)

    @contextmanager
    def _asking(self, what: str) -> Iterator[Callable[..., dict[str, Any]]]:
        """A function that sends a verb in the bridge's name. Raises GesturedError, which is counted and logged."""
        try:
            with Control(self._path, ANSWER_S, "--gates") as control:
                yield partial(control.ask, bridge=self.name, gate=self.name)
            self._said = ""
        except GesturedError as error:
            self._counts.add("commands", "failed")
            if str(error) != self._said:  # a bus may repeat a command that fails
                self._said = str(error)
                self._counts.say(f"{what}: {error}")
            raise
