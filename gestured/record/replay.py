"""The replay of a tape through the hub that the daemon uses: equal packets at equal times give equal events."""

import dataclasses
import math
import sys
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, groupby
from operator import sub
from pathlib import Path
from statistics import median
from typing import Any

from gestured.client.say import say
from gestured.core.classifier import Classifier, Scores
from gestured.core.errors import ModelError, RecordingError
from gestured.core.events import Event, Onset
from gestured.core.facts import Arrived, Changed, Decided, Dropped, Fact, Fault, Taken
from gestured.core.frames import Frame, Segment
from gestured.core.hub import Hub
from gestured.core.own import Examples, from_dict
from gestured.core.scene import Scene
from gestured.core.sensor import ABSENT_S
from gestured.record.tape import Tape
from gestured.record.tape_reader import read

ONSETS = 64  # contacts from which the offset of a sensor's own clock is learned


@dataclass(frozen=True)
class Maker:
    """The daemon that made a tape, as the tape describes it."""

    scene: Scene
    models: list[str]  # as the daemon's settings name them, best first
    sha256: str  # of the model that answered
    own: Examples = field(default_factory=dict)  # the user's own gestures


def opened(path: str | Path) -> tuple[Tape, Maker]:
    """The tape in a file, and the daemon that made it. If the tape is cut off, standard error says so.

    Raises RecordingError, which names the file.
    """
    found = read(path)
    try:
        made_by = maker(found.scene)
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None
    if not found.whole:
        say(f"{path}: is cut off or damaged; what is good before that is used", to=sys.stderr)
    return found, made_by


def maker(told: Mapping[str, Any]) -> Maker:
    """The daemon that a tape's `scene` describes. Raises RecordingError for a scene that no daemon writes."""
    settings = told.get("settings")
    if not isinstance(settings, dict):
        raise RecordingError("scene: expected settings, as the daemon writes them")
    try:
        model = told["model"]
        gestures = tuple(_text(name) for name in told["gestures"])
        scene = Scene.from_dict(settings, gestures, (model["rows"], model["columns"]))
        models = [_text(name) for name in (settings["model"], *settings["fallback"])]
        return Maker(scene, models, str(model.get("sha256")), from_dict(told.get("own", {})))
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise RecordingError(
            f"scene: expected gestures and settings as the daemon writes them: {repr(error)[:200]}"
        ) from None


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"expected text, found {value!r}")
    return value


class Mute(Classifier):
    """A classifier that has no answers, for replays that only need the frames."""

    def __init__(self, gestures: Sequence[str]) -> None:
        self.gestures = tuple(gestures)

    def classify(self, segment: Segment) -> Scores:
        """Give no answer: raises ModelError."""
        raise ModelError("it has no answers")


@dataclass
class Played:
    """How long a sensor of a replay sent, and from when on it was known, in s since the tape's first packet."""

    seconds: float = 0.0  # pauses count as ABSENT_S at most: a sensor may send only while it is touched
    _last: float = math.inf
    _learned: list[tuple[float, float]] = field(default_factory=list)  # when it was new, and when it was known

    def see(self, taken: Taken) -> None:
        """Remember one more frame that was used."""
        t = taken.frame.t
        self.seconds += min(max(t - self._last, 0.0), ABSENT_S)
        self._last = t
        if taken.new:
            self._learned.append((t, math.inf))
        if taken.ready and self._learned[-1][1] == math.inf:
            self._learned[-1] = (self._learned[-1][0], t)

    def knew(self, t: float) -> bool:
        """Whether the idle sensor had been learned by `t` s, so that a touch could be told from it."""
        before = bisect_right(self._learned, t + 1e-6, key=lambda one: one[0])  # stamps and labels are rounded
        return before > 0 and self._learned[before - 1][1] <= t


def frames_used(tape: Tape, scene: Scene) -> dict[str, list[Frame]]:
    """By sensor, the frames that the daemon used, at the times that it gave them, in s since the Unix epoch."""
    replay = Replay(tape, dataclasses.replace(scene, touches=True), Mute(scene.gestures))
    used: dict[str, list[Frame]] = {}
    for fact in replay.facts():
        if isinstance(fact, Taken):
            used.setdefault(fact.sensor, []).append(fact.frame)
    return {
        name: [dataclasses.replace(frame, t=frame.t + replay.epoch_of(name)) for frame in frames]
        for name, frames in used.items()
    }


class Replay:
    """Plays a tape with a classifier. The events' times count from the first packet, at `epoch` (s since 1970)."""

    def __init__(self, tape: Tape, scene: Scene, classifier: Classifier, *, provisional: bool = False) -> None:
        """`provisional`: whether provisional events are given, too.

        Raises RecordingError for a classifier that does not know the gestures that were in use.
        """
        try:
            self._hub = Hub(dataclasses.replace(scene, frames=True, gates=()), classifier)
        except ValueError as error:
            raise RecordingError(str(error)) from None
        self._hub.foresee(None if provisional else ())
        self.played: dict[str, Played] = {}
        self._start = tape.packets[0].t_ns if tape.packets else 0
        self.epoch = self._start / 1e9
        self._tape = tape
        # By sensor and the time of packets (ns): onsets of the contacts that these opened in the daemon, s since 1970.
        self._told: dict[tuple[str, int], list[float]] = {}
        for n, event in zip(tape.told, tape.events, strict=False):
            if event["type"] == "onset" and n:
                self._told.setdefault((event["sensor"], tape.packets[n - 1].t_ns), []).append(event["onset"])
        # By sensor: s by which the latest onsets were later in the daemon.
        self._ahead: dict[str, deque[float]] = {}

    def events(self) -> Iterator[Event]:
        """All events of the tape, at whose end every sensor falls silent."""
        for fact in self.facts():
            if not isinstance(fact, Decided | Arrived | Taken | Dropped | Changed):
                yield fact

    def facts(self) -> Iterator[Event | Decided | Arrived | Taken | Dropped | Changed]:
        """All facts of the tape, events included; each frame that was used is a fact of its own."""
        now, count = 0.0, 0  # count: packets before this group
        told = zip(self._tape.told, self._tape.events, strict=False)
        gates = deque((n, event) for n, event in told if event["type"] == "gate")
        # By number of packets from the end: the oldest of these. After it stood still, a daemon serves packets in
        # another order than they came in, and does not decide by a time from which packets still wait.
        oldest = list(accumulate((packet.t_ns for packet in reversed(self._tape.packets)), min))
        for t_ns, packets in groupby(self._tape.packets, lambda packet: packet.t_ns):
            now, before = (t_ns - self._start) / 1e9, now
            if not self._tape.scene:  # made by no daemon that could have stood still: a pause is a silence
                silent = before + 2 * self._hub.scene.stale_s
                yield from self._seen(self._hub.tick(silent) if silent < now else [])
            while gates and gates[0][0] <= count:
                yield from self._seen(self._gate(gates.popleft()[1]))
            waiting = [(packet.data, packet.source) for packet in packets]
            facts = self._hub.receive(waiting, now)
            self._compare([fact for fact in facts if isinstance(fact, Onset)], t_ns)
            yield from self._seen(facts)
            yield from self._seen(self._hub.tick((oldest[-1 - count] - self._start) / 1e9))
            count += len(waiting)
        yield from self._seen(self._hub.flush(now + self._hub.scene.stale_s))

    def _compare(self, opened: list[Onset], t_ns: int) -> None:
        """Compare the contacts that the packets of `t_ns` opened here with those that they opened in the daemon."""
        for sensor in {one.sensor for one in opened}:
            here = [one.onset + self.epoch for one in opened if one.sensor == sensor]
            there = self._told.get((sensor, t_ns), [])
            if len(here) == len(there):
                self._ahead.setdefault(sensor, deque(maxlen=ONSETS)).extend(map(sub, there, here))

    def epoch_of(self, sensor: str) -> float:
        """The s to add to a sensor's times to get the daemon's, in s since 1970, as far as the tape was played.

        A sensor's own clock may have been ahead at the beginning of the tape, which no packet shows. So the offset is
        learned from contacts that the same packets have opened here and in the daemon.
        """
        own_clock = self._hub.scene.clock_of(sensor) == "sensor"
        return self.epoch + (median(self._ahead.get(sensor) or [0.0]) if own_clock else 0.0)

    def knew(self, sensor: str, t: float) -> bool:
        """Whether a sensor's idle state was known at `t`, in the daemon's time, as far as the tape was played."""
        return sensor in self.played and self.played[sensor].knew(t - self.epoch_of(sensor))

    def _gate(self, told: Mapping[str, Any]) -> list[Fact]:
        """Set a sensor's gates as the tape has them; if they were so before its first packet, also the arming."""
        since, until = told["since"] - self.epoch, told.get("until")
        if since >= 0 or told.get("armed") is not True or not isinstance(until, int | float):
            return self._hub.put(told["sensor"], told["closed"], max(since, 0.0))
        return self._hub.put(told["sensor"], told["closed"], 0.0, until - self.epoch)

    def _seen(self, facts: list[Fact]) -> Iterator[Event | Decided | Arrived | Taken | Dropped | Changed]:
        for fact in facts:
            if isinstance(fact, Fault):
                raise fact.error  # in a replay nobody depends on the other sensors
            if isinstance(fact, Taken):
                self.played.setdefault(fact.sensor, Played()).see(fact)
            yield fact
