"""A gate that a bus closes and opens: the bridge passes its commands to the daemon's socket for bridges.

Only the daemon stores for which sensors the gate is closed. The bridge repeats these sensors, so that the daemon knows
that bridge and bus are alive; without repetitions the gate stays closed, and the daemon reports it as overdue.
"""

import time
from collections.abc import Iterable
from pathlib import Path

from gestured.bridge.counts import Counts
from gestured.client.control import Control
from gestured.client.lines import Refused
from gestured.core.errors import GesturedError

ON, OFF = "ON", "OFF"  # commands: open the gate of a sensor, so that it listens, or close it
ALIVE_S = 30.0  # the daemon is promised a repetition within so long
REPEAT_S = 10.0  # a closed gate is repeated so often
ANSWER_S = 2.0  # the longest wait for the daemon, which answers in milliseconds


class Gate:
    """One gate, by its name, of all sensors of a daemon."""

    def __init__(self, path: Path, name: str, counts: Counts) -> None:
        """`path` is the daemon's socket for bridges."""
        self.name = name
        self._path, self._counts = path, counts
        self._said = ""  # why the last command failed, if it did
        self._due = 0.0  # monotonic s, the next repetition
        self._answered = 0.0  # s since 1970, when the daemon last carried out a command

    def obey(self, sensor: str, command: str) -> list[str]:
        """Carry out a command; returns the gates of the sensor that are closed now. Raises GesturedError."""
        try:
            with Control(self._path, ANSWER_S, "--gates") as control:
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
                self._said = ""
                return closed
        except GesturedError as error:
            self._counts.add("commands", "failed")
            if str(error) != self._said:  # a bus may repeat a command that fails
                self._said = str(error)
                self._counts.say(f"{sensor} {command}: {error}")
            raise

    def repeat(self, closed: Iterable[str], told: float) -> None:
        """Repeat every REPEAT_S that the gate is closed for these sensors, by the daemon's status at `told` (s, epoch).

        A status that is older than the daemon's last answer is ignored: it may call a gate closed that was opened
        since, and a repetition would close it. Several such statuses may wait if the daemon was slow.
        """
        # An answer that seems to be much newer than the status shows that a clock was set back.
        if 0.0 <= self._answered - told < ALIVE_S or time.monotonic() < self._due:
            return
        self._due = time.monotonic() + REPEAT_S
        for sensor in closed:
            try:
                self.obey(sensor, OFF)
            except GesturedError:
                return  # `obey` has logged the error; the next repetition may succeed
