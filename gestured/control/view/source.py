"""The source of the page's data: the daemon's state each second, frames of the sensors looked at, and events."""

import threading
from collections.abc import Iterator
from dataclasses import asdict
from itertools import takewhile
from pathlib import Path
from typing import Any

from gestured.client.control import Control
from gestured.client.fields import wrong_field
from gestured.client.lines import Refused, Unreachable
from gestured.client.web.outbox import Outbox
from gestured.control.findings import examine_sensors
from gestured.control.flag import flag, flag_path
from gestured.control.operate import WORDS
from gestured.core.errors import GesturedError

GATE = "view"  # the gate that the page closes and opens
AGAIN_S = 0.5  # the pause before the next connection to a daemon that has gone
SILENT_S = 4.0  # the longest wait for an answer or the next line, since a daemon tells its state each second

Looked = tuple[list[str], bool] | None  # sensors, and whether their counts as sent are wanted; None: nobody looks


class Looker(Outbox):
    """The outbox of a browser that looks at a sensor; with `raw` it also gets the counts as they were sent."""

    def __init__(self, sensor: str, raw: bool) -> None:
        super().__init__()
        self.sensor, self.raw = sensor, raw

    def touch(self, told: dict[str, Any]) -> None:
        """Put a touch event. Waiting moves of one finger are merged, so that they displace no other event."""
        with self._changed:
            for _, waits in takewhile(lambda one: one[1].get("phase") == "move", reversed(self._rest)):
                if (waits["id"], waits["touch"]) == (told["id"], told["touch"]):
                    waits |= told | {by: waits[by] + told[by] for by in ("dx", "dy")}
                    return
        self.put("touch", dict(told))


class Source:
    """One daemon, for any number of browsers. Nothing is requested from the daemon while nobody looks."""

    def __init__(self, control: Path, folder: Path) -> None:
        """`control`: path of the control socket; `folder`: for flagged recordings."""
        self._control, self._folder = control, folder
        self._open: list[Looker] = []
        self._changed = threading.Condition()
        self._closed = threading.Event()
        self._state: dict[str, Any] = {}  # the daemon's state as the page gets it
        self._looking: Control | None = None  # the connection over which the daemon streams
        self._looked_at: Looked = None
        self._latest: dict[str, dict[str, Any]] = {}  # the last view of each sensor that is looked at
        threading.Thread(target=self._look_again_and_again, daemon=True).start()

    def join(self, outbox: Looker) -> None:
        """Fill the outbox of a browser from now on."""
        if self._state:
            outbox.put("sensors", self._state)
        if outbox.sensor in self._latest:
            outbox.put("frame", self._latest[outbox.sensor])
        with self._changed:
            self._open.append(outbox)
            self._look_anew()

    def leave(self, outbox: Looker) -> None:
        """Fill the outbox of a browser no more."""
        with self._changed:
            self._open.remove(outbox)
            self._look_anew()

    def ask(self, verb: str, sensor: str) -> str:
        """Let the daemon recalibrate a sensor, or inhibit or allow it by GATE. Returns words; raises GesturedError."""
        gate = {} if verb == "recalibrate" else {"gate": GATE}
        with Control(self._control) as control:
            answer = control.ask(verb, sensor=sensor, **gate)
            with control.reading():
                return "; ".join(WORDS[verb](answer))

    def flag(self, note: str) -> str:
        """Keep what the flight recorder holds as a recording. Returns words; raises GesturedError."""
        path = flag_path(self._folder)
        with Control(self._control) as control:
            keeper = flag(control, path, note)
        return f"{path}: {keeper.packets} packets, {keeper.events} events"

    def close(self) -> None:
        """End all streams, and the connection to the daemon."""
        self._closed.set()
        for outbox in list(self._open):
            outbox.close()
        with self._changed:
            self._look_anew()

    def _look_again_and_again(self) -> None:
        """Follow the daemon, with a new connection when the last one failed or other sensors are looked at."""
        while not self._closed.is_set():
            with self._changed:
                self._changed.wait_for(lambda: self._open or self._closed.is_set())
            try:
                with Control(self._control, SILENT_S) as control:
                    self._look(control)
            except (GesturedError, OSError) as error:
                self._state = {}  # a browser that joins meanwhile gets no old state
                self._tell("gone", {"reason": str(error)})
                self._closed.wait(AGAIN_S)

    def _look(self, control: Control) -> None:
        """Pass on what the daemon streams, until browsers want something else. Raises Refused, Unreachable."""
        self._latest = {}
        looked_at = self._wanted()
        if looked_at is None:
            return
        sensors, raw = looked_at
        control.ask("follow", sensors=sensors, raw=raw)
        with self._changed:
            self._looking, self._looked_at = control, looked_at
            self._look_anew()
        with control.reading():
            for line in self._lines(control):
                if words := wrong_field(line):
                    raise Refused(f"{self._control} says something that gestured does not say: {words}")
                self._pass_on(line)

    def _lines(self, control: Control) -> Iterator[dict[str, Any]]:
        """The lines that the daemon streams. Raises Unreachable if none comes for SILENT_S."""
        control.socket.settimeout(SILENT_S)
        try:
            yield from control.lines()
        except TimeoutError:
            said = f"has said nothing for {SILENT_S:g} s: it hangs, or the machine is very busy"
            raise Unreachable(f"the daemon on {self._control} {said}") from None

    def _pass_on(self, line: dict[str, Any]) -> None:
        kind = line["type"]
        if kind in ("view", "provisional", "touch"):  # for those who look at this sensor
            if kind == "view":
                self._latest[line["sensor"]] = line
            for outbox in [one for one in list(self._open) if one.sensor == line["sensor"]]:
                if kind == "touch":
                    outbox.touch(line)
                else:
                    outbox.put("frame" if kind == "view" else "event", line)
        elif kind == "state":
            told = {key: line[key] for key in ("version", "state", "sensors")}
            found = [asdict(finding) for finding in examine_sensors(line) if finding.level != "ok"]
            recorder = line["flight_recorder"]["limit_bytes"] > 0
            told |= {"model": line["model"]["active"], "findings": found, "flight_recorder": recorder}
            self._state = told
            self._tell("sensors", told)
        else:
            self._tell("event", line)

    def _wanted(self) -> Looked:
        looks = list(self._open)
        if not looks or self._closed.is_set():
            return None
        return sorted({outbox.sensor for outbox in looks if outbox.sensor}), any(outbox.raw for outbox in looks)

    def _look_anew(self) -> None:
        """End the connection if the daemon is to stream something else, or nothing."""
        self._changed.notify_all()
        if self._looking is not None and self._looked_at != self._wanted():
            self._looking.finish()

    def _tell(self, kind: str, what: dict[str, Any]) -> None:
        for outbox in list(self._open):
            outbox.put(kind, what)
