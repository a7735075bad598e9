"""The daemon that a bridge mirrors: whether it is there, its gestures and sensors, and the age of its events."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from gestured.bridge.counts import Counts
from gestured.client.subscriber import Subscriber
from gestured.core.address import is_sensor
from gestured.core.messages import quoted

NOTICE_S = 0.25  # an absent daemon is noticed after so long
GONE = "gone"  # the type of a line that the bridge makes: the daemon is not there; connecting goes on
MOST_SENSORS = 4096  # the most names that are remembered, since any sender of frames can invent some
DRIFT = 0.1  # s in a second by which a sensor's clock may drift; real ones drift a ten-thousandth of it
HELD_S = 1.5  # a daemon that has not said its status for so long was held up, since it does so each second
WORKS_OFF_S = 5.0  # the longest that a daemon which was held up takes to work off the packets that have waited
OLD_S = 1.0  # an older event is of no use: a window would open a second late

Line = Mapping[str, Any]


def follow(subscriber: Subscriber, counts: Counts) -> Iterator[Line]:
    """Each line of a daemon, also its hello, and a line GONE if it is not there; until the subscriber is closed.

    The subscriber needs a timeout of NOTICE_S. A line with a name that cannot stand in a topic is counted and skipped.
    """
    missed = False
    while True:
        try:
            for _, line in subscriber.lines():
                if words := _wrong_name(line):
                    counts.wrong(f"a line of the daemon is passed over: {words}")
                    continue
                missed = missed and line["type"] != "hello"
                yield line
            return
        except TimeoutError:
            if not missed and not subscriber.connected:
                missed = True
                yield {"type": GONE, "path": str(subscriber.path)}


def _wrong_name(line: Line) -> str | None:
    """The name in a line that cannot stand in a topic or a key, and what was expected; None if all can."""
    said = line["sensors"] if line["type"] in ("hello", "status") else ()
    for name in (line["type"], line.get("sensor", "-"), *said):
        if not is_sensor(name):
            return f"{quoted(name)}: expected letters, digits, _ and -, at most 64"
    return None


class Daemon:
    """The state of a daemon, from its lines."""

    def __init__(self, sensors: Sequence[str] | None, gestures: Sequence[str] | None, counts: Counts) -> None:
        """`sensors` and `gestures`: the subscription's filters, None for all. `counts`: told if the daemon is there."""
        self._counts = counts
        self.hello: Line = {}  # with each sensor's last sequence so far; empty while the daemon is away
        self.version = ""  # of the last daemon that was there
        self.states: dict[str, str] = {}  # by sensor, the latest news last; kept while the daemon is away
        self.gestures: list[str] | None = None  # None until the daemon has told them
        self._unsure: set[str] = set()  # names that only the hello has told: perhaps of `gesturectl emit`
        self.listening: dict[str, Line] = {}  # by sensor: gates and arming, as in `status`; only if there are any
        self._wanted_sensors, self._wanted_gestures = sensors, gestures
        self._told = math.inf  # s since 1970, when the daemon last said its status
        self._held = 0.0  # s, how long the daemon was held up the last time
        self._over = 0.0  # s since 1970, until when its events may have waited for so long
        self._lags: dict[str, tuple[float, float]] = {}  # by sensor: smallest lag in s, and when it was updated

    def take(self, line: Line) -> None:
        """Take one line of `follow`."""
        match line["type"]:
            case "hello":
                self.hello, self.version = line, line["version"]
                self._lags.clear()  # a restarted daemon takes each sensor's clock anew
                self._gestures(line["gestures"])
                self.listening = dict(line.get("gates", {}))
                self._unsure |= line["sensors"].keys() - self.states.keys()
                self._heard({name: self.states.get(name, "no_data") for name in line["sensors"]})
                self._counts.connected("daemon", True, "daemon is there")
            case "gestures":
                self._gestures(line["gestures"])
            case "gesture" if self.hello:
                sequences = self.hello["sensors"]
                if line["sensor"] in sequences or len(sequences) < MOST_SENSORS:
                    self.hello = {**self.hello, "sensors": {**sequences, line["sensor"]: line["sequence"]}}
            case "status":
                held, self._told = line["time"] - self._told, line["time"]
                if held > HELD_S:
                    self._held, self._over = held, self._told + WORKS_OFF_S
                elif held < 0:  # the clock was set back, so an event on its way seemed to come before its decision
                    self._over = 0.0
                    self._lags.clear()
                self.listening = dict(line.get("gates", {}))
                self._heard(line["sensors"])
                self._unsure = set()
            case "gone":
                self.hello = {}
                self._counts.connected("daemon", False, f"no daemon answers on {line['path']}; waiting for it")

    def is_silent_by(self, gate: str) -> bool:
        """Whether that gate is closed for any sensor."""
        return any(gate in told.get("closed", ()) for told in self.listening.values())

    def age(self, event: Line, now: float) -> float:
        """How many seconds ago an event was decided; `now` is in seconds since the epoch.

        A sensor's own clock may be wrong by any time, so the age is the lag beyond the smallest lag so far. But if the
        daemon was held up, the event may have waited for as long. The event of `gesturectl emit` has the daemon's
        clock, which says nothing about the sensor's.
        """
        if event.get("decided") is None or event.get("test"):
            return 0.0
        lag, held = float(now - event["decided"]), now - self._told
        if held <= HELD_S:
            held = self._held if now < self._over else 0.0
        least = lag - min(max(lag, 0.0), held)
        if event["sensor"] not in self._lags and len(self._lags) >= MOST_SENSORS:
            self._lags.clear()
        smallest, found = self._lags.get(event["sensor"], (least, now))
        smallest = min(least, smallest + DRIFT * max(now - found, 0.0))
        if not held:
            self._lags[event["sensor"]] = smallest, now
        return lag - smallest

    def payload(self, event: Line) -> bytes:
        """An event as it is published: the daemon's line as JSON, with the daemon's `instance`."""
        told = {**event, "instance": self.hello.get("instance")}
        return json.dumps(told, separators=(",", ":")).encode()

    def _heard(self, heard: Mapping[str, str]) -> None:
        """Take the states of all sensors that a daemon knows; one that a restarted daemon does not know is silent.

        The dict is replaced, since another thread may read the old one.
        """
        wanted = self._wanted_sensors
        new = {name: state for name, state in heard.items() if wanted is None or name in wanted}
        states = {name: "no_data" for name in self.states if name not in new and name not in self._unsure} | new
        self.states = dict(list(states.items())[-MOST_SENSORS:])

    def _gestures(self, known: Sequence[str]) -> None:
        wanted = self._wanted_gestures
        self.gestures = [name for name in known if wanted is None or name in wanted]
