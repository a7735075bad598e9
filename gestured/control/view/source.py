"""What the page shows, as the daemon tells it: sensors each second, frames that somebody looks at, events."""

import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gestured.client.control import Control
from gestured.client.subscriber import Subscriber
from gestured.control.flag import flag, flag_lines, flag_path
from gestured.control.view.outbox import Outbox
from gestured.core.errors import GesturedError
from gestured.core.messages import EVENT_TYPES

SENSORS_S = 1.0
AGAIN_S = 0.5  # before a daemon that has gone is asked again
KEPT_S = 30.0  # of packets, where the daemon has no flight recorder
LINE_BYTES = 500  # that Python takes for a line, its packet not counted
KEPT_BYTES = 64 << 20  # of them at the most, as base64
OF_ALL = tuple(kind for kind in EVENT_TYPES if kind not in ("provisional", "status"))  # events of sensors not looked at


class Source:
    """One daemon, for any number of browsers. Its threads ask for nothing as long as nobody looks."""

    def __init__(self, control: Path, folder: Path) -> None:
        """What is flagged is put into `folder`."""
        self._control, self._folder = control, folder
        self._open: list[Outbox] = []
        self._changed = threading.Condition()
        self._closed = threading.Event()
        self._status: dict[str, Any] = {}
        self._subscriber: Subscriber | None = None
        self._looking: Control | None = None  # the connection over which the daemon streams views
        self._looked_at: tuple[list[str], bool] = [], False  # sensors that it streams, and whether with raw counts
        self._latest: dict[str, dict[str, Any]] = {}  # the last view of each sensor that is looked at
        self._tap: Control | None = None  # where there is no flight recorder: the view keeps packets itself
        self._scene: dict[str, Any] = {}
        self._kept: deque[tuple[float, int, dict[str, Any]]] = deque()  # s, bytes, a tap's line
        self._size = 0  # bytes that are kept
        for work in (self._tell_sensors, self._tell_frames):
            threading.Thread(target=self._again_and_again, args=(work,), daemon=True).start()

    def join(self, outbox: Outbox) -> None:
        """Somebody looks."""
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
        for one in (self._subscriber, self._tap):
            if one is not None:
                one.close()

    def _again_and_again(self, work: Callable[[Control], None]) -> None:
        """Work on a connection to the daemon, and on the next one once it is back."""
        while not self._closed.is_set():
            try:
                self._wait_for_somebody()
                with Control(self._control) as control:
                    work(control)
            except (GesturedError, OSError) as error:
                self._tell("gone", {"reason": str(error)})
                self._closed.wait(AGAIN_S)

    def _wait_for_somebody(self) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._open or self._closed.is_set())

    def _tell_sensors(self, control: Control) -> None:
        while not self._closed.is_set():
            self._wait_for_somebody()
            self._status = control.ask("status")
            if self._subscriber is None:
                self._subscriber = Subscriber(self._status["addresses"]["socket"], types=OF_ALL)
                self._hear(self._subscriber, looked_at=False)
            if self._tap is None and not self._status["flight_recorder"]["limit_bytes"]:
                self._tap = Control(self._control)
                threading.Thread(target=self._keep, args=(self._tap,), daemon=True).start()
            self._tell("sensors", self._sensors())
            self._closed.wait(SENSORS_S)

    def _sensors(self) -> dict[str, Any]:
        status = self._status
        told = {key: status[key] for key in ("version", "state", "sensors")}
        return told | {"model": status["model"]["active"], "gestures": status["model"]["gestures"]}

    def _tell_frames(self, control: Control) -> None:
        """Whatever is looked at, and all events of it, until somebody looks at something else.

        Provisional events are asked of these sensors alone: the daemon runs its model for every sensor whose
        provisional events somebody asks for.
        """
        self._latest = {}
        sensors, raw = looked_at = self._wanted()
        path = control.ask("status")["addresses"]["socket"]
        control.ask("follow", sensors=sensors, raw=raw)
        with self._changed:
            self._looking, self._looked_at = control, looked_at
            self._look_anew()
        with Subscriber(path, types=EVENT_TYPES, sensors=sensors) as subscriber:
            self._hear(subscriber, looked_at=True)
            for frame in control.lines():
                self._latest[frame["sensor"]] = frame
                for outbox in list(self._open):
                    if outbox.sensor == frame["sensor"]:
                        outbox.frame(frame)

    def _wanted(self) -> tuple[list[str], bool]:
        """The sensors that somebody looks at, and whether somebody wants their counts as they were sent."""
        looks = list(self._open)
        return sorted({outbox.sensor for outbox in looks if outbox.sensor}), any(outbox.raw for outbox in looks)

    def _look_anew(self) -> None:
        self._changed.notify_all()
        if self._looking is not None and self._looked_at != self._wanted():
            self._looking.finish()

    def _hear(self, subscriber: Subscriber, *, looked_at: bool) -> None:
        threading.Thread(target=self._tell_events, args=(subscriber, looked_at), daemon=True).start()

    def _tell_events(self, subscriber: Subscriber, looked_at: bool) -> None:
        """Tell each browser the events of the sensor that it looks at, or those of all others."""
        try:
            for event in subscriber:
                for outbox in list(self._open):
                    if "sensor" in event and (event["sensor"] == outbox.sensor) is looked_at:
                        outbox.put("event", event)
        except GesturedError as error:
            self._tell("gone", {"reason": str(error)})

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
