"""The hub: all sensors of a scene, from packets and the time of their arrival to facts, such as events.

Every program takes this path: the daemon, a replay, an export and a recording session differ only in where packets
come from and in what they do with the facts. A hub has no socket, clock, log or metric; its times are seconds on one
clock that never goes back, the daemon's monotonic one or a tape's own.

A bug in the path of one sensor is not raised: it becomes a `Fault`, that sensor's contact is ended, and the other
sensors go on, since a daemon in a vehicle must not die of one sensor's odd frame.
"""

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

from gestured.core import bank
from gestured.core.beside.reading import Reading
from gestured.core.classifier import Classifier
from gestured.core.events import Gate
from gestured.core.facts import Changed, Dropped, Fact, Fault
from gestured.core.listening import Gates, Listening
from gestured.core.owner import Source
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.core.wire import Arrival, Block, Decoder

FORGET_S = 60.0  # s; a sensor that has been silent for longer gives its place to one that sends
REMEMBERED = 4096  # sensors that gave up their place and whose last sequence and id are remembered
HOSTS = 1024  # hosts for which the answer of `Scene.may_send` is remembered


class Hub:
    """All sensors of a scene."""

    def __init__(self, scene: Scene, classifier: Classifier, *, later: bool = False) -> None:
        """A hub without sensors yet. Raises ValueError if the `classifier` does not know a gesture of the scene.

        With `later`, most runs of the model wait for `ask` and `look`, so as not to delay answers of other sensors. A
        segment that was not asked about when its answer is due is asked about then, so the answers are the same.
        """
        self._sensors: dict[str, Sensor] = {}
        self._numbers: dict[str, tuple[int, int]] = {}  # by sensor without a place: its last sequence and id
        self._banks = bank.Banks()
        self._missed = False  # whether this machine has had no room for a packet since the last `receive`
        # How many sensors each source owned at the last tick; those that were silent for FORGET_S do not count.
        self.owners: Mapping[Source, int] = {}
        self._foreseen: frozenset[str] | None = frozenset()  # sensors with provisional events; None is all
        self._waits: dict[str, Sensor] = {}  # sensors in which a contact may be over before the next frame
        # s: `wait` finds nothing before this time, and from then on probably something; infinite if no sensor waits.
        self.due = math.inf
        self._followed: frozenset[str] | None = frozenset()  # sensors with touch events; None is all
        self._later = later
        self._armed: dict[str, float] = {}  # by sensor that will come armed: until when, in s on the hub's clock
        self.gates = Gates(scene.gates)  # a change of the scene leaves the gates as they are
        self.asks: dict[str, Sensor] = {}  # sensors that wait for `ask`, the one that has waited longest first
        self.looks: dict[str, Sensor] = {}  # sensors that wait for `look`, in the same order
        self._set(scene, classifier)

    def receive(self, packets: Sequence[tuple[bytes, Source]], now: float) -> list[Fact]:
        """Take packets that were found waiting at `now`, each with its source."""
        facts = [] if now < self.gates.due else self._shut(now, partial(self.gates.lapse, now))
        if self._missed:  # only the next frame of each sensor shows whether it has missed packets
            self._banks.doubted, self._missed = set(self._sensors), False
        together = len(packets) >= bank.FEW
        waited: list[Sensor] = []
        for name, arrivals in self._read(packets, now, facts, together=together).items():
            sensor = self._sensors[name]
            if name in self._waits:
                sensor.elapse(now, facts)
            due = sensor.receive(arrivals, now, facts, missed=name in self._banks.doubted)
            self._banks.doubted.discard(name)
            if due < math.inf:
                self._waits[name], self.due = sensor, min(self.due, due)
            if sensor.shown is not None:
                self.asks[name] = sensor
            if (self._foreseen is None or self._foreseen) and sensor.looks:
                self.looks[name] = sensor
            waited.append(sensor)
        if together and len(waited) + len(self._banks.homes) >= bank.FEW:
            for sensor in waited:
                sensor.run(self._banks.enter, now, facts)
        return facts

    def _read(
        self, packets: Sequence[tuple[bytes, Source]], now: float, facts: list[Fact], *, together: bool
    ) -> dict[str, list[Arrival]]:
        """The frames of packets, by the sensor that each may feed; frames that a bank has taken are left out."""
        if self.scene.allow:
            facts += [Dropped("not_allowed", source) for _, source in packets if not self._may_send(source[0])]
            packets = [packet for packet in packets if self._may_send(packet[1][0])]
        found: dict[int, list[Arrival]] = {}
        blocks = self._together(packets, facts) if together else []
        alone: Collection[int] = range(len(packets))
        if blocks and sum([len(block.packets) for block in blocks]) == len(packets):
            alone = ()
        elif blocks:
            alone = sorted(set(alone).difference(*(block.packets for block in blocks)))
        for n in alone:
            found[n] = self._decode(*packets[n], facts)
        if blocks:
            others = {arrival.sensor for arrivals in found.values() for arrival in arrivals}
            left = self._banks.take(blocks, [source for _, source in packets], others, now, facts)
            found |= {n: [block.arrival(place)] for n, (block, place) in left.items()}
        waiting: dict[str, list[Arrival]] = {}
        for n in sorted(found) if blocks else found:
            for arrival in found[n]:
                try:
                    if self._admits(arrival.sensor, packets[n][1], now, facts):
                        waiting.setdefault(arrival.sensor, []).append(arrival)
                except Exception as error:  # the packets before and after this one are good
                    facts.append(Fault(None, error))
        return waiting

    def wait(self, now: float) -> list[Fact]:
        """Answer the contacts whose wait is over at `now`, though no packet has come since."""
        facts: list[Fact] = []
        if now >= self.due:
            for sensor in sorted(self._waits.values(), key=lambda sensor: sensor.elapses_at):
                sensor.elapse(now, facts)
            self.looks |= {name: sensor for name, sensor in self._waits.items() if sensor.looks}
            due = {name: sensor.elapses_at for name, sensor in self._waits.items()}
            self._waits = {name: sensor for name, sensor in self._waits.items() if due[name] < math.inf}
            self.due = min(due.values(), default=math.inf)
        return facts

    def ask(self, now: float) -> list[Fact]:
        """Ask the model about the segment that has waited longest to be classified; its answer comes when due."""
        facts: list[Fact] = []
        while self.asks:
            sensor = self.asks.pop(next(iter(self.asks)))
            if sensor.shown is not None:
                sensor.run(Sensor.ask, now, facts)
                break
        return facts

    def look(self, now: float) -> list[Fact]:
        """Run the model once, on the open contact that has waited longest; this may give a provisional event.

        A look that was not taken when the sensor's next frame comes is dropped.
        """
        facts: list[Fact] = []
        while self.looks:
            sensor = self.looks.pop(next(iter(self.looks)))
            if sensor.looks:
                sensor.run(Sensor.look, now, facts)
                break
        return facts

    def tick(self, now: float) -> list[Fact]:
        """Do what the time alone decides (`wait`, silences, gates, arming), after all that arrived until `now`."""
        facts = [] if now < self.gates.due else self._shut(now, partial(self.gates.lapse, now))
        facts += self.wait(now)
        for name in self._banks.silent(now - self.scene.stale_s):
            self._leave(self._sensors[name], now, facts)
        for sensor in self._banks.tick():
            sensor.review(now, facts)
            self._banks.tell(sensor)
        sensors = self._sensors.values()
        self.owners = Counter(sensor.owner.source for sensor in sensors if now - sensor.owner.heard <= FORGET_S)
        for sensor in [sensor for sensor in sensors if sensor.name not in self._banks.homes]:
            sensor.review(now, facts)
            if not sensor.silent and sensor.stale(now):
                facts.append(Changed(sensor.name, "silent", sensor.owner.source))
                sensor.end(now, facts)
        return facts

    def flush(self, now: float) -> list[Fact]:
        """Answer or cancel all open contacts, since no packet will come after `now`."""
        facts: list[Fact] = []
        for sensor in self._out(now, facts):
            sensor.end(now, facts)
        return facts

    def missed(self) -> None:
        """Note that this machine had no room for a packet; the sensors' next frames show whose packet it was."""
        self._missed = True

    def restart(self, sensors: Sequence[str], now: float) -> list[Fact]:
        """Learn these sensors anew and cancel their open contacts. Raises KeyError for a sensor that is not there."""
        facts = self.wait(now)  # a contact that is over is answered first
        for name in sensors:
            self._leave(self._sensors[name], now, facts)
            self._sensors[name].restart(now, facts)
        return facts

    def change(self, scene: Scene, classifier: Classifier, now: float) -> list[Fact]:
        """Go on in another scene; what was learned of a sensor stays if it still holds. ValueError as for a new hub."""
        facts = self.wait(now)  # a contact that is over is answered by the scene before
        unheard = [name for name in {**self.scene.sensors, **scene.sensors} if name not in self._sensors]
        told = {gate.sensor: (gate.armed, gate.closed) for gate in self.listening(now)}
        self._set(scene, classifier)
        listening = {gate.sensor: gate for gate in self.listening(now)}
        for name in unheard:  # one that the scene no longer names is told to have neither gates nor arming
            gate = listening.get(name) or Gate(name, None, (), None, now)
            if (gate.armed, gate.closed) != told.get(name, (None, ())):
                facts.append(gate)
        for sensor in self._out(now, facts):
            sensor.change(scene, classifier, now, facts)
            sensor.follow(facts, asked=self._follows(sensor.name))
        return facts

    def inhibit(self, sensor: str | None, gate: str, now: float, seconds: float = math.inf) -> list[Fact]:
        """Close a gate for a sensor, or for all (None), even new ones, for so many seconds or until it is opened.

        While a gate is closed each contact is unknown, and so is one that began before it was closed or opened.
        """
        return self._shut(now, partial(self.gates.inhibit, sensor, gate, now + seconds))

    def allow(self, sensor: str | None, gate: str, now: float) -> list[Fact]:
        """Open a gate for a sensor or (None) for all."""
        return self._shut(now, partial(self.gates.allow, sensor, gate))

    def put(self, sensor: str, closed: Iterable[str], now: float, armed_until: float | None = None) -> list[Fact]:
        """Close exactly these gates for a sensor; one that is not there yet will come armed until `armed_until` (s)."""
        if armed_until is not None:
            self._armed[sensor] = armed_until
        return self._shut(now, partial(self.gates.put, sensor, closed))

    def foresee(self, sensors: Collection[str] | None) -> None:
        """Give provisional events of these sensors, by name, or of all (None). Answers stay what they are.

        Each sensor that is touched costs up to 15 runs of the model a second.
        """
        self._foreseen = None if sensors is None else frozenset(sensors)
        for sensor in self._sensors.values():
            sensor.foresee(asked=self.foreseen(sensor.name), later=self._later)

    def foreseen(self, name: str) -> bool:
        """Whether somebody asks for a sensor's provisional events."""
        return self._foreseen is None or name in self._foreseen

    def follow(self, sensors: Collection[str] | None) -> list[Fact]:
        """Give touch events of these sensors, by name, or of all (None), if the scene has `touch`."""
        self._followed = None if sensors is None else frozenset(sensors)
        facts: list[Fact] = []
        for sensor in self._sensors.values():
            sensor.follow(facts, asked=self._follows(sensor.name))
        return facts

    def _follows(self, name: str) -> bool:
        return self.scene.touch and (self._followed is None or name in self._followed)

    def number(self, name: str) -> tuple[int, int]:
        """The next sequence and id of a sensor, for the events of a test; both count as used."""
        if name in self._sensors:
            return self._sensors[name].count()
        sequence, number = self._numbers.get(name, (0, 0))
        self._numbers[name] = sequence + 1, number + 1
        return self._numbers[name]

    def sequences(self) -> dict[str, int]:
        """The last sequence of each sensor that was heard, or tested."""
        gone = {name: sequence for name, (sequence, _) in self._numbers.items()}
        return gone | {name: sensor.sequence for name, sensor in self._sensors.items()}

    def knows(self, sensor: str) -> bool:
        """Whether a sensor was heard, or is in the scene: whether it has a reading."""
        return sensor in self._sensors or sensor in self.scene.sensors

    def readings(self, now: float) -> dict[str, Reading]:
        """What is known of each sensor, heard or in the scene, at `now`. Any thread may ask."""
        silent = {name: self._unheard(name, now) for name in self.scene.sensors}
        return silent | {
            name: sensor.reading(self._as_of(sensor, now)) for name, sensor in tuple(self._sensors.items())
        }

    def states(self, now: float) -> dict[str, str]:
        """The state of each sensor, as `readings` has it, in a fraction of the time."""
        silent = dict.fromkeys(self.scene.sensors, "no_data")
        shown = self._banks.states
        return silent | {name: shown.get(name) or sensor.condition(now)[0] for name, sensor in self._sensors.items()}

    def _as_of(self, sensor: Sensor, now: float) -> float:
        """The time in s at which a sensor's state is read: `now`; in a bank, that of the last frame it was shown."""
        return min(now, sensor.owner.heard) if sensor.name in self._banks.homes else now

    def listening(self, now: float) -> list[Gate]:
        """The gates and the arming of each sensor at `now`, without the sensors that have neither."""
        heard = dict(self._sensors)
        unheard = [self._unheard(name, now).gate for name in self.scene.sensors if name not in heard]
        told = [*unheard, *(sensor.listens(now) for sensor in heard.values())]
        return [gate for gate in told if gate is not None and (gate.closed or gate.armed is not None)]

    def view(self, name: str, now: float, *, raw: bool) -> dict[str, Any] | None:
        """The last frame and the state of a sensor at `now`, as JSON values; None if it was not heard."""
        sensor = self._sensors.get(name)
        if sensor is None:
            return None
        self._leave(sensor, now, [])
        return sensor.view(now, raw=raw)

    def _unheard(self, name: str, now: float) -> Reading:
        listening = Listening(self.scene.arming_of(name))
        listening.gate(self.gates.of(name), now)
        return Reading("no_data", self.scene.grid_of(name), gate=listening.told(name, now, -math.inf))

    def _shut(self, now: float, change: Callable[[], None]) -> list[Fact]:
        """Make a change of gates; the facts tell of each sensor, heard or in the scene, that has other gates then."""
        before = {name: self.gates.of(name) for name in self.scene.sensors if name not in self._sensors}
        change()
        changed = [name for name, closed in before.items() if closed != self.gates.of(name)]
        facts: list[Fact] = [gate for name in changed if (gate := self._unheard(name, now).gate) is not None]
        self._banks.show()  # a gate changes nothing of what a bank knows, so sensors stay there
        for sensor in self._sensors.values():
            sensor.shut(self.gates.of(sensor.name), now, facts)
        return facts

    def _set(self, scene: Scene, classifier: Classifier) -> None:
        missing = [gesture for gesture in scene.gestures if gesture not in classifier.gestures]
        if missing:
            known = ", ".join(classifier.gestures)
            raise ValueError(f"gestures: {', '.join(missing)} were asked for, the classifier knows {known}")
        self.scene, self._classifier = scene, classifier
        self._decoder = Decoder(scene.addresses, scene.grid_of, keep_touches=scene.touches)
        self._may_send = lru_cache(HOSTS)(scene.may_send)
        self._full_until = -math.inf  # s; until then no sensor has been silent for long enough to lose its place

    def _together(self, packets: Sequence[tuple[bytes, Source]], facts: list[Fact]) -> list[Block]:
        """The frames of packets that can be read together; after a bug each is read by itself."""
        try:
            return self._decoder.together([packet for packet, _ in packets])
        except Exception as error:
            facts.append(Fault(None, error))
            return []

    def _decode(self, packet: bytes, source: Source, facts: list[Fact]) -> list[Arrival]:
        try:
            arrivals, errors = self._decoder.decode(packet, source)
        except Exception as error:  # the packets before and after this one are good
            facts.append(Fault(None, error))
            return []
        for wrong in errors:
            facts.append(Dropped(wrong.reason, source, text=str(wrong)))
        return arrivals

    def _admits(self, name: str, source: Source, now: float, facts: list[Fact]) -> bool:
        """Whether a `source` may feed the sensor of a frame; the sensor is made if it is new, and leaves its bank."""
        sensor = self._sensors.get(name) or self._new(name, source, now, facts)
        if sensor is None:
            return False
        self._leave(sensor, now, facts)
        if not sensor.owner.admits(source, now, self.scene.stale_s):
            facts.append(Dropped("second_source", source))
            return False
        sensor.silent = False
        return True

    def _out(self, now: float, facts: list[Fact]) -> list[Sensor]:
        """All sensors, after they have left their banks."""
        for name in tuple(self._banks.homes):
            self._leave(self._sensors[name], now, facts)
        return list(self._sensors.values())

    def _leave(self, sensor: Sensor, now: float, facts: list[Fact]) -> None:
        """Take a sensor out of its bank, if it is in one; a bug in that is added to `facts`."""
        if sensor.name in self._banks.homes:
            sensor.run(self._banks.leave, now, facts)

    def _new(self, name: str, source: Source, now: float, facts: list[Fact]) -> Sensor | None:
        """A new sensor of that name, or None if there is no place for it."""
        if self._full(name, now, facts):
            facts.append(Dropped("too_many_sensors", source))
            return None
        numbers = self._numbers.pop(name, (0, 0))
        sensor = self._sensors[name] = Sensor(name, self.scene, self._classifier, source, numbers)
        sensor.foresee(asked=self.foreseen(name), later=self._later)
        sensor.follow(facts, asked=self._follows(name))
        facts.append(Changed(name, "new", source))
        sensor.shut(self.gates.of(name), now, facts, armed_until=self._armed.pop(name, -math.inf))
        return sensor

    def _full(self, name: str, now: float, facts: list[Fact]) -> bool:
        """Whether there is no place for a new sensor; places for sensors that the scene names are kept free.

        One packet can hold hundreds of names, so `_full_until` spares a search of all sensors for each of them.
        """
        named = self.scene.sensors
        if name in named:
            return False
        if now <= self._full_until:
            return True
        if len(self._sensors) < self.scene.max_sensors - len(named):  # this is so even if none of them is named
            return False
        self._banks.show()
        strangers = [sensor for sensor in self._sensors.values() if sensor.name not in named]
        if len(strangers) < self.scene.max_sensors - len(named):
            return False
        longest = min(strangers, key=lambda sensor: sensor.owner.heard, default=None)
        if longest is None or now - longest.owner.heard <= FORGET_S:
            self._full_until = now if longest is None else longest.owner.heard + FORGET_S
            return True
        self._leave(longest, now, facts)
        longest.end(now, facts)  # its contact is still open if no tick came meanwhile, as in a process that was stopped
        self._forget(longest)
        return False

    def _forget(self, sensor: Sensor) -> None:
        """Give a sensor's place away. Should it return, its sequences and ids go on where they were."""
        del self._sensors[sensor.name]
        self._banks.doubted.discard(sensor.name)
        self._waits.pop(sensor.name, None)
        self.asks.pop(sensor.name, None)
        self.looks.pop(sensor.name, None)
        if len(self._numbers) >= REMEMBERED:
            self._numbers.pop(next(iter(self._numbers)))
        self._numbers[sensor.name] = sensor.sequence, sensor.segments
