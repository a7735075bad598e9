"""A tape through the same code as in the daemon, without one: decode, stamp, recognise, event for event."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from gestured.core.conditioning import Mounting
from gestured.core.errors import ModelError, RecordingError
from gestured.core.events import Event, Onset
from gestured.core.frames import Frame, Segment
from gestured.core.front_end import FrontEnd
from gestured.core.owner import Owner
from gestured.core.recognizer import Classifier, Recognizer, Scores
from gestured.core.segmentation import Timing
from gestured.core.stamping import Stamper
from gestured.core.wire import Addresses, Arrival, Decoder
from gestured.record.tape import Packet, Tape, read

SENSORS = 4096  # that a daemon's settings allow, at most
MAX_SENSORS = 64  # where a tape does not say
STALE_S = 60  # that a daemon's settings allow, at most


def opened(path: str | Path) -> tuple[Tape, "Scene"]:
    """A tape and what of its scene decides. RecordingError names the file."""
    found = read(path)
    try:
        return found, Scene(found.scene)
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None


class Scene:
    """The part of a tape's `scene` that decides. Raises RecordingError for one that says something else."""

    def __init__(self, scene: Mapping[str, Any]) -> None:
        settings = scene.get("settings")
        if not isinstance(settings, dict):
            raise RecordingError("scene: expected settings, as the daemon writes them")
        try:
            self.gestures = [_text(name) for name in scene["gestures"]]
            if not self.gestures:
                raise ValueError("none were in use")
            self.addresses = Addresses(settings["addresses"]["pressure"], settings["addresses"]["trajectory"])
            self.stale_s = float(settings["stale_s"])
            model = scene["model"]
            self.sha256 = str(model.get("sha256"))
            self.ladder = [_text(name) for name in (settings["model"], *settings["fallback"])]  # best first
            self._grid = tuple(settings["grid"] or (model["rows"], model["columns"]))
            self._clock = settings["clock"]
            self._sensors: Mapping[str, Any] = dict(settings["sensors"])
            parts: Mapping[str, Any] = dict(settings["per_gesture"])
            self.thresholds = {n: float(p["threshold"]) for n, p in parts.items() if p["threshold"] is not None}
            self.refractory = {n: float(p["refractory_s"]) for n, p in parts.items()}
            self._sensors_at_most = int(settings.get("max_sensors", MAX_SENSORS))
            numbers = [*self.thresholds.values(), *self.refractory.values()]
            if not all(map(math.isfinite, numbers)) or not 0 < self.stale_s <= STALE_S:
                raise ValueError(f"stale_s of 0 to {STALE_S} s, and finite thresholds")
            if len(self._sensors) > SENSORS:
                raise ValueError(f"{len(self._sensors)} sensors, expected at most {SENSORS}")
            for name in ("", *self._sensors):  # whatever is wrong is found now
                self.grid(name), self.front_end(name), self.stamper(name)
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise RecordingError(
                f"scene: expected gestures and settings as the daemon writes them: {repr(error)[:200]}"
            ) from None

    def admits(self, name: str, sensors: Collection[str]) -> bool:
        """Whether there is a place for one sensor more beside `sensors`; those of the settings have theirs."""
        strangers = sum(sensor not in self._sensors for sensor in sensors)
        return name in self._sensors or strangers < self._sensors_at_most - len(self._sensors)

    def grid(self, name: str) -> tuple[int, int]:
        """Rows and columns of a sensor's frames, as they are sent."""
        rows, columns = self._sensors.get(name, {}).get("grid") or self._grid
        if not (2 <= int(rows) <= 64 and 2 <= int(columns) <= 64):
            raise ValueError(f"a grid of {rows} x {columns}")
        return int(rows), int(columns)

    def front_end(self, name: str) -> FrontEnd:
        """A sensor's, new."""
        own = self._sensors.get(name, {})
        return FrontEnd(
            name,
            *self.grid(name),
            mounting=Mounting(own.get("rotate", 0), own.get("mirror", False)),
            wait_for_double_tap="double_tap" in self.gestures,
            timing=Timing(stale_s=self.stale_s),
        )

    def stamper(self, name: str) -> Stamper:
        """A sensor's, new."""
        clock = self._sensors.get(name, {}).get("clock") or self._clock
        if clock not in ("arrival", "sensor"):
            raise ValueError(f"clock: {clock!r}")
        return Stamper(clock)


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"expected text, found {value!r}")
    return value


class Mute:
    """A `Classifier` that has no answers: for what can be said of the frames alone."""

    def __init__(self, gestures: Sequence[str]) -> None:
        self.gestures = tuple(gestures)

    def classify(self, segment: Segment) -> Scores:
        """Raises ModelError."""
        raise ModelError("it has no answers")


class Stream:
    """One sensor's."""

    def __init__(self, scene: Scene, name: str, packet: Packet, classifier: Classifier) -> None:
        self.owner = Owner(packet.source)
        self.stamper = scene.stamper(name)
        self.recognizer = Recognizer(
            scene.front_end(name),
            classifier,
            gestures=scene.gestures,
            thresholds=scene.thresholds,
            refractory=scene.refractory,
        )
        self.stamps: list[tuple[float, float]] = []  # s: when a frame arrived, and when it was felt
        self.onsets: list[float] = []  # s
        self._learned: list[tuple[float, float]] = []  # s: since when it was new, and from when on it was known

    def knew(self, t: float) -> bool:
        """Whether the idle sensor had been learned by `t` s, so that a touch could be told from it."""
        since = [known for new, known in self._learned if new <= t]
        return bool(since) and since[-1] <= t

    def take(self, arrivals: Sequence[Arrival], now: float) -> Iterator[Event]:
        """Push frames that were found waiting at `now` s."""
        for event in self._push(arrivals, now):
            if isinstance(event, Onset):
                self.onsets.append(event.onset)
            yield event

    def _push(self, arrivals: Sequence[Arrival], now: float) -> Iterator[Event]:
        for arrival, stamp in zip(arrivals, self.stamper.stamp(arrivals, now), strict=True):
            if stamp.dropped:
                continue
            self.stamps.append((now, stamp.t))
            if stamp.restarted:
                yield from self.recognizer.reset()
            if stamp.restarted or not self._learned:
                self._learned.append((stamp.t, math.inf))
            yield from self.recognizer.push(Frame(stamp.t, arrival.values, arrival.touches, stamp.lost))
            if self._learned[-1][1] == math.inf and self.recognizer.front_end.ready:
                self._learned[-1] = (self._learned[-1][0], stamp.t)


class Replay:
    """Plays a tape with a classifier. The events' times count from its first packet, at `epoch` (s since 1970)."""

    def __init__(self, tape: Tape, scene: Scene, classifier: Classifier) -> None:
        """Raises RecordingError for a classifier that does not know the gestures that were in use."""
        self.scene = scene
        missing = [name for name in self.scene.gestures if name not in classifier.gestures]
        if missing:
            known = ", ".join(classifier.gestures)
            raise RecordingError(f"gestures: {', '.join(missing)} were in use, the model knows {known}")
        self.streams: dict[str, Stream] = {}
        self._start = tape.packets[0].t_ns if tape.packets else 0
        self.epoch = self._start / 1e9
        self._tape, self._classifier = tape, classifier
        self._decoder = Decoder(self.scene.addresses, self.scene.grid, keep_touches=False)

    def events(self) -> Iterator[Event]:
        """All that comes of it, to the end, where every sensor falls silent."""
        now = 0.0
        for t_ns, packets in groupby(self._tape.packets, lambda packet: packet.t_ns):
            now = (t_ns - self._start) / 1e9
            yield from self._silent(now)
            waiting: dict[str, list[Arrival]] = {}
            for packet in packets:
                for arrival in self._decoder.decode(packet.data, packet.source)[0]:
                    name = arrival.sensor
                    if name not in self.streams:
                        if not self.scene.admits(name, self.streams):
                            continue
                        self.streams[name] = Stream(self.scene, name, packet, self._classifier)
                    if self.streams[name].owner.admits(packet.source, now, self.scene.stale_s):
                        waiting.setdefault(name, []).append(arrival)
            for name, arrivals in waiting.items():
                yield from self.streams[name].take(arrivals, now)
        for stream in self.streams.values():
            yield from stream.recognizer.flush(stream.stamper.at(now + self.scene.stale_s))

    def _silent(self, now: float) -> Iterator[Event]:
        for stream in self.streams.values():
            if now - stream.owner.heard > self.scene.stale_s:
                yield from stream.recognizer.flush(stream.stamper.at(now))
