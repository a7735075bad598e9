"""What the page shows, as the daemon tells who looks on: its state each second, frames of what is looked at, events."""

import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

from gestured.client.control import Control
from gestured.control.flag import flag, flag_lines, flag_path
from gestured.control.view.outbox import Outbox
from gestured.core.errors import GesturedError

AGAIN_S = 0.5  # before a daemon that has gone is asked again
KEPT_S = 30.0  # of packets, where the daemon has no flight recorder
LINE_BYTES = 500  # that Python takes for a line, its packet not counted
KEPT_BYTES = 64 << 20  # of them at the most, as base64

Looked = tuple[list[str], bool] | None  # sensors, and whether with their counts as they were sent; None: nobody looks


class Source:
    """One daemon, for any number of browsers. It is asked for nothing as long as nobody looks."""

    def __init__(self, control: Path, folder: Path) -> None:
        """What is flagged is put into `folder`."""
        self._control, self._folder = control, folder
        self._open: list[Outbox] = []
        self._changed = threading.Condition()
        self._closed = threading.Event()
        self._status: dict[str, Any] = {}
        self._looking: Control | None = None  # the connection over which the daemon streams
        self._looked_at: Looked = None
        self._latest: dict[str, dict[str, Any]] = {}  # the last view of each sensor that is looked at
        self._tap: Control | None = None  # where there is no flight recorder: the view keeps packets itself
        self._scene: dict[str, Any] = {}
        self._kept: deque[tuple[float, int, dict[str, Any]]] = deque()  # s, bytes, a tap's line
        self._size = 0  # bytes that are kept
        threading.Thread(target=self._look_again_and_again, daemon=True).start()

    def join(self, outbox: Outbox) -> None:
        """A browser begins to look: fill its outbox from now on."""
        if self._status:
            outbox.put("sensors", self._sensors())
        if outbox.sensor in self._latest:
            outbox.frame(self._latest[outbox.sensor])
        with self._changed:
            self._open.append(outbox)
            self._look_anew()

    def leave(self, outbox: Outbox) -> None:
        """And looks no more."""
        with self._changed:
            self._open.remove(outbox)
            self._look_anew()

    def recalibrate(self, sensor: str) -> str:
        """Have the daemon learn a sensor anew; what was done, in words. Raises GesturedError."""
        with Control(self._control) as control:
            control.ask("recalibrate", sensor=sensor)
        return f"{sensor}: learned anew, leave it untouched for a second"

    def flag(self, note: str) -> str:
        """Keep the last 30 s as a recording; what was done, in words. Raises GesturedError."""
        path = flag_path(self._folder)
        if self._status["flight_recorder"]["limit_bytes"]:
            with Control(self._control) as control:
                keeper = flag(control, path, note)
        elif not self._scene:
            raise GesturedError("nothing was kept so far; try again in a moment")
        else:
            keeper = flag_lines(self._scene, (line for *_, line in list(self._kept)), path, note)
        return f"{path}: {keeper.packets} packets, {keeper.events} events"

    def close(self) -> None:
        """Ask for nothing more."""
        self._closed.set()
        for outbox in list(self._open):
            outbox.close()
        with self._changed:
            self._look_anew()
        if self._tap is not None:
            self._tap.close()

    def _look_again_and_again(self) -> None:
        """Look on over a connection to the daemon, and over the next one once it is back or something else is asked."""
        while not self._closed.is_set():
            with self._changed:
                self._changed.wait_for(lambda: self._open or self._closed.is_set())
            try:
                with Control(self._control) as control:
                    self._look(control)
            except (GesturedError, OSError) as error:
                self._tell("gone", {"reason": str(error)})
                self._closed.wait(AGAIN_S)

    def _look(self, control: Control) -> None:
        """Tell what the daemon streams, until somebody looks at something else."""
        self._latest = {}
        looked_at = self._wanted()
        if looked_at is None:
            return
        sensors, raw = looked_at
        control.ask("follow", sensors=sensors, raw=raw)
        with self._changed:
            self._looking, self._looked_at = control, looked_at
            self._look_anew()
        for line in control.lines():
            if line["type"] == "view":
                self._latest[line["sensor"]] = line
                for outbox in self._lookers(line["sensor"]):
                    outbox.frame(line)
            elif line["type"] == "state":
                self._status = line
                self._tell("sensors", self._sensors())
                if self._tap is None and not line["flight_recorder"]["limit_bytes"]:
                    self._tap = Control(self._control)
                    threading.Thread(target=self._keep, args=(self._tap,), daemon=True).start()
            elif line["type"] == "provisional":
                for outbox in self._lookers(line["sensor"]):
                    outbox.put("event", line)
            else:
                self._tell("event", line)

    def _sensors(self) -> dict[str, Any]:
        status = self._status
        told = {key: status[key] for key in ("version", "state", "sensors")}
        return told | {"model": status["model"]["active"], "gestures": status["model"]["gestures"]}

    def _lookers(self, sensor: str) -> list[Outbox]:
        return [outbox for outbox in list(self._open) if outbox.sensor == sensor]

    def _wanted(self) -> Looked:
        looks = list(self._open)
        if not looks or self._closed.is_set():
            return None
        return sorted({outbox.sensor for outbox in looks if outbox.sensor}), any(outbox.raw for outbox in looks)

    def _look_anew(self) -> None:
        """Have the connection ended where the daemon is to stream something else, or nothing."""
        self._changed.notify_all()
        if self._looking is not None and self._looked_at != self._wanted():
            self._looking.finish()

    def _keep(self, tap: Control) -> None:
        """Keep what a tap says, until the daemon goes or nobody looks any more."""
        try:
            self._scene = tap.ask("tap")
            for line in tap.lines():
                if not self._open or self._closed.is_set():
                    break
                size = len(line.get("data", "")) + LINE_BYTES
                self._kept.append((time.monotonic(), size, line))
                self._size += size
                self._forget()
        except (GesturedError, OSError):
            pass  # that the daemon is gone, the others say
        tap.close()
        self._kept.clear()
        self._scene, self._tap, self._size = {}, None, 0

    def _forget(self) -> None:
        oldest = time.monotonic() - KEPT_S
        while self._kept and (self._kept[0][0] < oldest or self._size > KEPT_BYTES):
            self._size -= self._kept.popleft()[1]

    def _tell(self, kind: str, what: dict[str, Any]) -> None:
        for outbox in list(self._open):
            outbox.put(kind, what)
