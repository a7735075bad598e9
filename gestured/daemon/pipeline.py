"""From arrivals to events: one recognizer a sensor, who may feed it, and what happens when it falls silent
or breaks.

Time comes in as an argument. A bug in the path of one sensor is logged with its traceback, counted, and
answered by resetting that sensor's recognizer: its contact ends, the other sensors go on. That is the one
place where a bug does not end the program: a daemon in a vehicle that dies of one sensor's odd frame helps
nobody.
"""

import ipaddress
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

from gestured.core.conditioning import Mounting
from gestured.core.events import Cancelled, Event, Gesture, Onset, Release, Unknown
from gestured.core.frames import Frame, Segment
from gestured.core.front_end import FrontEnd
from gestured.core.owner import Owner, Source
from gestured.core.recognizer import Recognizer, Scores
from gestured.core.segmentation import Timing
from gestured.core.stamping import Stamper
from gestured.core.wire import Addresses, Arrival, Decoder
from gestured.daemon.log import Throttle, log
from gestured.daemon.metrics import Metrics
from gestured.daemon.reading import Reading
from gestured.daemon.settings import SensorSettings, Settings
from gestured.daemon.values import Grid
from gestured.daemon.vitals import Vitals, faulty
from gestured.daemon.watch import Watched
from gestured.model.ladder import Ladder

FORGET_S = 60.0  # a sensor that is silent for this long gives its place to one that sends
GIVEN = 4096  # names of sensors that are not there, whose numbers are remembered
HELD_S = 60.0  # of arrivals: a contact that lasts longer by the sensor's own clock is given up
HOSTS = 1024  # remembered decisions of the allow-list
DOUBLE_TAP = "double_tap"
SILENT = ("no_data", "stale")  # states of sensors that are not there now
Emit = Callable[[Event], None]
Network = ipaddress.IPv4Network | ipaddress.IPv6Network


def allowed(host: str, networks: Sequence[Network]) -> bool:
    """Whether a host's address lies in one of the networks; any does where there are none."""
    address = ipaddress.ip_address(host)
    mapped = getattr(address, "ipv4_mapped", None)
    return not networks or any((mapped or address) in network for network in networks)


@dataclass(slots=True)
class Sensor:
    """One stream: its state and its owner."""

    name: str
    label: str  # in metrics
    recognizer: Recognizer
    stamper: Stamper
    owner: Owner
    silent: bool = False  # and has been flushed
    open: int | None = None  # id of the contact that was not released yet
    since: float = 0.0  # s, when the frame arrived that opened it
    answered: bool = True  # whether that contact has its answer
    lost: int = 0  # frames, by its own counter, or by what this machine had no room for
    missed: int = 0  # how often this machine had no room for a packet, when the last frame came
    vitals: Vitals = field(default_factory=Vitals)


class Pipeline:
    """All sensors. `emit` takes each event as it comes."""

    def __init__(self, settings: Settings, ladder: Ladder, metrics: Metrics, emit: Emit) -> None:
        self.sensors: dict[str, Sensor] = {}
        self.watched = Watched(ladder)
        self.given: dict[str, tuple[int, int]] = {}  # sequence and id that sensors which are not there have used
        self.behind_s = 0.0  # for so long the oldest packet waits that has arrived and was not taken yet
        self._settings, self._metrics, self._emit = settings, metrics, emit
        self._throttle = Throttle()
        self._missed = 0  # times that the kernel had no room for a packet
        self.owners: frozenset[Source] = frozenset()  # sources that own a sensor which is there, as of the last tick
        self._configure()

    def _configure(self) -> None:
        # Trajectories have no consumer yet: they are passed over at their address.
        addresses = Addresses(self._settings.addresses.pressure, self._settings.addresses.trajectory)
        self._decoder = Decoder(addresses, self.grid, keep_touches=False)
        self._allowed: dict[str, bool] = {}  # host -> whether it may send

    @property
    def gestures(self) -> tuple[str, ...]:
        """The gestures in use, in the model's order."""
        chosen = self._settings.gestures
        return tuple(g for g in self.watched.gestures if chosen is None or g in chosen)

    def grid(self, sensor: str) -> Grid:
        """The grid in which a sensor sends."""
        own = self._settings.sensors.get(sensor)
        model = Grid(self.watched.ladder.rows, self.watched.ladder.columns)
        return (own and own.grid) or self._settings.grid or model

    def receive(self, packets: Sequence[tuple[bytes, Source]], now: float) -> None:
        """Take packets that had arrived by `now` (monotonic seconds), each with its source."""
        batch: dict[str, tuple[Sensor, list[Arrival]]] = {}
        for packet, source in packets:
            try:
                self._packet(packet, source, now, batch)
            except Exception:  # what came before and after it is good
                self.bug("in the decoding of a packet", source=source[0])
        for sensor, arrivals in batch.values():
            self.take(sensor, arrivals, now)

    def missed(self) -> None:
        """The kernel had no room for a packet: whose it was shows where the next frame comes after a pause."""
        self._missed += 1

    def _packet(
        self, packet: bytes, source: Source, now: float, batch: dict[str, tuple[Sensor, list[Arrival]]]
    ) -> None:
        if self._settings.allow and not self._may_send(source[0]):
            self.drop("not_allowed", source=source[0])
            return
        arrivals, errors = self._decoder.decode(packet, source)
        for error in errors:
            self.drop(error.reason, source=source[0], error=str(error))
        for arrival in arrivals:
            name = arrival.sensor
            sensor = self.admit(name, source, now)
            if sensor is not None:
                if name not in batch:
                    batch[name] = (sensor, [])
                batch[name][1].append(arrival)

    def _may_send(self, host: str) -> bool:
        known = self._allowed.get(host)
        if known is None:
            if len(self._allowed) >= HOSTS:
                self._allowed.clear()
            known = self._allowed[host] = allowed(host, self._settings.allow)
        return known

    def admit(self, name: str, source: Source, now: float) -> Sensor | None:
        """The sensor that a packet of `source` may feed, or None, counted, where it may not."""
        sensor = self.sensors.get(name)
        if sensor is None:
            if self._full(name, now):
                self.drop("too_many_sensors")
                return None
            sensor = self.sensors[name] = self._make(name, source)
            log.info("new sensor", sensor=name, source=f"{source[0]}:{source[1]}", grid=str(self.grid(name)))
        if not sensor.owner.admits(source, now, self._settings.stale_s):
            self.drop("second_source")
            return None
        sensor.silent = False
        return sensor

    def take(self, sensor: Sensor, arrivals: Sequence[Arrival], now: float) -> None:
        """Push frames that were found waiting at `now` (monotonic seconds)."""
        frames = self._metrics.frames
        taken = 0
        try:
            stamps = sensor.stamper.stamp(arrivals, now, missed=sensor.missed != self._missed)
        except Exception:
            self._publish(sensor, self._recover(sensor, now))
            return
        sensor.missed = self._missed
        sensor.vitals.arrived(now, len(arrivals), sensor.recognizer.front_end.rate_hz)
        for arrival, stamp in zip(arrivals, stamps, strict=True):
            if stamp.dropped:
                frames.add(sensor.label, stamp.dropped)
                continue
            if stamp.lost:
                frames.add(sensor.label, "lost", count=stamp.lost)
                sensor.lost += stamp.lost
            if stamp.implausible:
                self._metrics.implausible.add()
            try:
                if stamp.restarted:
                    self._throttle.warn("sensor restarted", "restarted", sensor=sensor.name)
                    self.restart(sensor)
                if sensor.recognizer.front_end.touched:
                    self._publish(sensor, sensor.recognizer.due(stamp.t))
                events = sensor.recognizer.push(Frame(stamp.t, arrival.values, arrival.touches, stamp.lost))
            except Exception:
                events = self._recover(sensor, stamp.t)
            else:
                taken += 1
            if events:
                self._publish(sensor, events, now)
        if sensor.open is not None and now - sensor.since > HELD_S:
            self._publish(sensor, sensor.recognizer.give_up(sensor.stamper.at(now)))
        if taken:
            frames.add(sensor.label, "ok", count=taken)

    def tick(self, now: float) -> None:
        """Close what is open where a sensor has been silent for longer than `stale_s`."""
        self.owners = frozenset(sensor.owner.source for sensor in self.sensors.values() if not sensor.silent)
        for sensor in self.sensors.values():
            if not sensor.silent and self._stale(sensor, now):
                self._throttle.warn("sensor is silent", "silent", sensor=sensor.name)
                self.flush(sensor, now)

    def review(self) -> None:
        """What is looked at once a second, beside the way of a frame."""
        for sensor in self.sensors.values():
            sensor.vitals.review(sensor.recognizer.front_end)

    def flush(self, sensor: Sensor, now: float) -> None:
        """The sensor has nothing more to say: answer or cancel what is open."""
        sensor.silent = True
        sensor.vitals.silent()
        t = sensor.stamper.at(now)
        try:
            events = sensor.recognizer.flush(t)
        except Exception:
            events = self._recover(sensor, t)
        self._publish(sensor, events)

    def restart(self, sensor: Sensor) -> None:
        """Learn a sensor anew; a contact that is open is cancelled."""
        sensor.vitals.restart()
        self._publish(sensor, sensor.recognizer.reset())

    def reload(self, settings: Settings, ladder: Ladder) -> None:
        """Go on with other settings and models; what a sensor has learned stays where it still holds."""
        waits = DOUBLE_TAP in self.gestures
        old, self._settings = self._settings, settings
        watched, shadow = Watched(ladder), self.watched.shadow
        if shadow is not None and shadow.candidate.gestures == watched.gestures:
            watched.shadow = shadow
        elif shadow is not None:
            shadow.close()
        self.watched = watched
        self._configure()
        for name, sensor in self.sensors.items():
            front_end, fresh = sensor.recognizer.front_end, self._front_end(name)
            another_clock = _clock(old, name) != _clock(settings, name)
            if another_clock or waits != (DOUBLE_TAP in self.gestures) or not _alike(front_end, fresh):
                self._publish(sensor, sensor.recognizer.reset())
                fresh.segments = front_end.segments  # its segments are numbered on
                front_end = fresh
            if another_clock:
                sensor.stamper = Stamper(_clock(settings, name))
            sensor.recognizer = self._recognizer(front_end, sensor.recognizer.sequence)

    def states(self, now: float) -> dict[str, str]:
        """State of each sensor, heard or in the file: "no_data", "starting", "ok", "degraded" (taxels are bridged),
        "faulty" (too many are) or "stale" (heard, but not now)."""
        silent = dict.fromkeys(self._settings.sensors, "no_data")
        return silent | {name: self._state(sensor, now) for name, sensor in tuple(self.sensors.items())}

    def readings(self, now: float) -> dict[str, Reading]:
        """What is known of each sensor; any thread may ask."""
        sensors = dict(self.sensors)
        return {
            name: _reading(sensors[name], state) if name in sensors else Reading(state)
            for name, state in self.states(now).items()
        }

    def drop(self, reason: str, count: int = 1, **fields: object) -> None:
        """Count what was dropped; say so at a bounded rate."""
        self._metrics.dropped.add(reason, count=count)
        self._throttle.warn("dropped", reason, **fields)

    def muted(self, senders: Sequence[Source | str]) -> None:
        """Say at a bounded rate that these senders of a flood are not heard for a while."""
        names = [sender if isinstance(sender, str) else f"{sender[0]}:{sender[1]}" for sender in senders]
        self._throttle.warn("senders of a flood are not heard for some seconds", "muted", senders=names)

    def bug(self, what: str, **fields: object) -> None:
        """Count a bug that was caught; log its traceback at a bounded rate."""
        self._metrics.internal_errors.add()
        self._throttle.error("a bug, caught", what, **fields)

    def _stale(self, sensor: Sensor, now: float) -> bool:
        """Whether a sensor is silent; one whose frames wait for us is not."""
        return now - self.behind_s - sensor.owner.heard > self._settings.stale_s

    def _state(self, sensor: Sensor, now: float) -> str:
        if self._stale(sensor, now):
            return "stale"
        front_end = sensor.recognizer.front_end
        if not front_end.ready:
            return "starting"
        return "faulty" if faulty(front_end) else "degraded" if front_end.bad_taxels else "ok"

    def _full(self, name: str, now: float) -> bool:
        """Whether there is no place for a new sensor; places for those in the file are kept free."""
        named = self._settings.sensors
        if name in named:
            return False
        strangers = [sensor for sensor in self.sensors.values() if sensor.name not in named]
        if len(strangers) < self._settings.max_sensors - len(named):
            return False
        for sensor in strangers:
            if now - sensor.owner.heard > FORGET_S:
                self._forget(sensor)
                return False
        return True

    def _forget(self, sensor: Sensor) -> None:
        """Take a sensor off the list; what it has numbered is numbered on should it return."""
        del self.sensors[sensor.name]
        if len(self.given) >= GIVEN:
            self.given.pop(next(iter(self.given)))
        self.given[sensor.name] = sensor.recognizer.sequence, sensor.recognizer.front_end.segments

    def number(self, name: str) -> tuple[int, int]:
        """The next sequence and id of a sensor, for an event that is made up; they count as used."""
        sensor = self.sensors.get(name)
        if sensor is None:
            sequence, number = self.given.get(name, (0, 0))
            self.given[name] = sequence + 1, number + 1
            return self.given[name]
        sensor.recognizer.sequence += 1
        sensor.recognizer.front_end.segments += 1
        return sensor.recognizer.sequence, sensor.recognizer.front_end.segments

    def _make(self, name: str, source: Source) -> Sensor:
        sequence, number = self.given.pop(name, (0, 0))
        front_end = self._front_end(name)
        front_end.segments = number
        recognizer = self._recognizer(front_end, sequence)
        stamper = Stamper(_clock(self._settings, name))
        label = self._metrics.sensor_label(name)
        return Sensor(name, label, recognizer, stamper, Owner(source), missed=self._missed)

    def _front_end(self, name: str) -> FrontEnd:
        own = self._settings.sensors.get(name, SensorSettings())
        return FrontEnd(
            name,
            *self.grid(name),
            mounting=Mounting(own.rotate, own.mirror),
            wait_for_double_tap=DOUBLE_TAP in self.gestures,
            timing=Timing(stale_s=self._settings.stale_s),
        )

    def _recognizer(self, front_end: FrontEnd, sequence: int) -> Recognizer:
        parts = self._settings.per_gesture
        return Recognizer(
            front_end,
            self.watched,
            gestures=self.gestures,
            thresholds={name: part.threshold for name, part in parts.items() if part.threshold is not None},
            refractory={name: part.refractory_s for name, part in parts.items()},
            sequence=sequence,
            witness=self._decided,
        )

    def _decided(self, segment: Segment, scores: Scores, known: bool) -> None:
        self._metrics.inference.observe(scores.took_s, scores.model)
        self.watched.note(segment, scores, known)

    def _publish(self, sensor: Sensor, events: Sequence[Event], now: float = 0.0) -> None:
        for event in events:
            if isinstance(event, Onset):
                sensor.open, sensor.answered, sensor.since = event.id, False, now
            elif isinstance(event, Gesture | Unknown | Cancelled):
                sensor.answered = True
            elif isinstance(event, Release):
                sensor.open = None
            self._emit(event)
        self.watched.look_on()

    def _recover(self, sensor: Sensor, t: float) -> list[Event]:
        """After a bug: start that sensor clean, and end what its consumers believe to be open."""
        self.bug("in the path of a sensor; its recognizer is reset", sensor=sensor.name)
        try:
            sensor.recognizer.reset()
        except Exception:
            self.bug("in the reset of a recognizer", sensor=sensor.name)
        events: list[Event] = []
        if sensor.open is not None:
            if not sensor.answered:
                events.append(Cancelled(sensor.name, sensor.open, "internal_error"))
            events.append(Release(sensor.name, sensor.open, t))
        return events


def _reading(sensor: Sensor, state: str) -> Reading:
    front_end, vitals = sensor.recognizer.front_end, sensor.vitals
    rate = 0.0 if state in SILENT else front_end.rate_hz
    return Reading(state, rate, vitals.jitter_s, front_end.bad_taxels, vitals.drift(front_end))


def _alike(one: FrontEnd, other: FrontEnd) -> bool:
    return (one.sent, one.mounting, one.timing) == (other.sent, other.mounting, other.timing)


def _clock(settings: Settings, name: str) -> Literal["arrival", "sensor"]:
    own = settings.sensors.get(name)
    return (own and own.clock) or settings.clock
