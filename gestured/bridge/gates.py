"""Gates that a bus closes and opens: its commands go to the daemon's socket for bridges, in one name of our own.

The daemon alone knows what is closed. What it says is closed in our name we repeat, so that it can tell that we and our
bus are alive; where we are not, the gate stays closed.
"""

import time
from collections.abc import Iterable
from pathlib import Path

from gestured.bridge.counts import Counts
from gestured.client.control import Control
from gestured.client.lines import Refused
from gestured.core.errors import GesturedError

ON, OFF = "ON", "OFF"  # commands: a sensor shall listen, as far as this gate goes, or be silent
ALIVE_S = 30.0  # within which we repeat what is closed
REPEAT_S = 10.0
ANSWER_S = 2.0  # for the daemon, which answers in milliseconds


class Gate:
    """One gate, by name, of each sensor of a daemon."""

    def __init__(self, path: Path, name: str, counts: Counts) -> None:
        """`path` is the daemon's socket for bridges."""
        self.name = name
        self._path, self._counts = path, counts
        self._said = ""  # why the last command failed
        self._due = 0.0  # monotonic s, when what is closed is repeated
        self._answered = 0.0  # s since 1970, when the daemon last did as asked

    def obey(self, sensor: str, command: str) -> list[str]:
        """Carry out a command; returns the gates of the sensor that are closed now. Raises GesturedError."""
        try:
            with Control(self._path, patience_s=ANSWER_S) as control:
                which = {"bridge": self.name, "gate": self.name, "sensor": sensor}
                if command == OFF:
                    answer = control.ask("inhibit", **which, seconds=ALIVE_S)
                else:
                    answer = control.ask("allow", **which)
                self._answered = time.time()
                closed = answer.get("sensors")
                closed = closed.get(sensor) if isinstance(closed, dict) else None
                if not isinstance(closed, list) or not all(isinstance(name, str) for name in closed):
                    raise Refused(f"{self._path} does not say which gates are closed: it is not the daemon's --gates")
                return closed
        except GesturedError as error:
            self._counts.add("commands", "failed")
            if str(error) != self._said:  # a bus may ask for the same again and again
                self._said = str(error)
                self._counts.say(f"{sensor} {command}: {error}")
            raise

    def repeat(self, closed: Iterable[str], told: float) -> None:
        """Repeat, now and then, that the gate is closed for these sensors, as the daemon's status of `told` says.

        A status that is older than the daemon's last answer, `told` in s since 1970, may say of a gate that it is
        closed which has been opened since; to repeat that would close it. Several wait where the daemon was slow.
        """
        if 0.0 <= self._answered - told < ALIVE_S or time.monotonic() < self._due:  # a clock may have been set back
            return
        self._due = time.monotonic() + REPEAT_S
        for sensor in closed:
            try:
                self.obey(sensor, OFF)
            except GesturedError:
                return  # it is said; the next time may do
