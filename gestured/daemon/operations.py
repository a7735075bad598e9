"""What an operator may ask of a running daemon: the table of the control socket's verbs."""

import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from itertools import chain

from gestured.core.address import is_sensor
from gestured.core.beside.reading import Reading
from gestured.core.events import Gesture, Onset, Place, Provisional, Release, Where
from gestured.core.hub import Hub
from gestured.core.where import zone_at
from gestured.daemon.caller import Connection
from gestured.daemon.desk import Desk
from gestured.daemon.gatekeeper import SENSOR, Gatekeeper
from gestured.daemon.own import OwnGestures
from gestured.daemon.publisher import Publisher
from gestured.daemon.request import Parameter, Refusal, Reply, ReplyStream, Verb
from gestured.daemon.snapshot import Snapshot
from gestured.daemon.status import scene
from gestured.daemon.tap import Taps, as_lines
from gestured.daemon.views import Views

TEST_SENSORS = 64  # the most names of sensors that were never heard which tests may use
TEST_S = 0.4  # how long a made-up gesture took
TEST_FRAMES = 6  # touched frames of a made-up gesture, at 15 Hz
MIDDLE = Place(0.5, 0.5)  # of a sensor: there a made-up gesture begins and ends

NAMED = Parameter(str, "a sensor's name, 1 to 64 of A-Z a-z 0-9 _ -", required=True, check=is_sensor)
SENSORS = Parameter(
    list,
    "a list of sensors' names",
    required=True,
    check=lambda names: all(isinstance(name, str) and is_sensor(name) for name in names),
)
RAW = Parameter(bool, "true or false")
COUNT = Parameter(int, "a number of examples")
LABEL = Parameter(str, "a gesture's name", required=True)


@dataclass
class Operations:
    """The verbs. Each checks everything before it changes anything."""

    hub: Hub
    desk: Desk
    publisher: Publisher
    taps: Taps
    own: OwnGestures
    views: Views
    snapshot: Callable[[], Snapshot]
    state: Callable[[], Reply]
    reload_all: Callable[[], Awaitable[str | None]]  # None, or why nothing has changed
    gates: Gatekeeper = field(init=False)
    _tested: set[str] = field(default_factory=set)  # names that tests have used of sensors that were never heard

    def __post_init__(self) -> None:
        self.gates = Gatekeeper(self.hub, self.desk)

    def verbs(self) -> dict[str, Verb]:
        """Name -> verb. This table is all that the control socket can do."""
        return {
            "status": Verb(self.status, changes=False),
            "reload": Verb(self.reload, slow=True),
            "recalibrate": Verb(self.recalibrate, {"sensor": SENSOR}),
            "emit": Verb(self.emit, {"gesture": LABEL, "sensor": SENSOR}),
            "view": Verb(self.view, {"sensor": NAMED, "raw": RAW}, changes=False),
            "follow": Verb(self.follow, {"sensors": SENSORS, "raw": RAW}, changes=False),
            "enrol": Verb(self.enrol, {"name": LABEL, "sensor": NAMED, "examples": COUNT}, slow=True),
            "gestures": Verb(self.gestures, changes=False),
            "forget": Verb(self.forget, {"name": LABEL}, slow=True),
            "tap": Verb(self.tap),
            "flight": Verb(self.flight),
        } | self.gates.verbs()

    async def status(self, connection: Connection) -> Reply:
        """How the daemon is, as `gesturectl status` shows it."""
        return self.state()

    async def reload(self, connection: Connection) -> Reply:
        """Read configuration and models anew; where one of them is bad, all old ones stay."""
        reason = await self.reload_all()
        if reason is not None:
            raise Refusal(f"{reason}; nothing has changed")
        snapshot = self.snapshot()
        return {"model": snapshot.models.active, "awaiting_restart": snapshot.awaiting_restart}

    async def recalibrate(self, connection: Connection, sensor: str | None = None) -> Reply:
        """Learn one idle sensor anew, or all. Refused while one of them is touched, since a hand is no baseline."""
        heard = _heard(self.snapshot(), sensor)
        chosen = list(heard) if sensor is None else [sensor]
        if not chosen:
            raise Refusal("no sensor was heard so far")
        touched = [name for name in chosen if heard[name].touched]
        if touched:
            raise Refusal(f"touched: {', '.join(touched)}; take the hand off, and whatever lies there")
        self.desk.take(self.hub.restart(chosen, time.monotonic()))
        return {"sensors": chosen}

    async def emit(self, connection: Connection, gesture: str, sensor: str | None = None) -> Reply:
        """A made-up gesture through every output, marked as a test; it takes the sensor's next numbers."""
        snapshot, sensor = self.snapshot(), sensor or "test"
        if gesture not in snapshot.every_gesture:
            raise Refusal(f"no gesture {gesture!r} is in use, expected one of {', '.join(snapshot.every_gesture)}")
        reading = snapshot.sensors.get(sensor)
        if reading is None or reading.source is None:
            if sensor not in self._tested and len(self._tested) >= TEST_SENSORS:
                raise Refusal(f"tests used {TEST_SENSORS} names of sensors that are not there; use one of them again")
            self._tested.add(sensor)
        elif reading.touched or reading.contact is not None:
            raise Refusal(f"{sensor} is touched; a test would mix with what is being done there")
        sequence, number = self.hub.number(sensor)
        scores = {name: float(name == gesture) for name in snapshot.gestures}
        now, model, own = snapshot.now, snapshot.models.active, gesture not in snapshot.gestures
        onset = now - TEST_S
        foreseen = self.hub.foreseen(sensor)
        answer = (sequence, onset, now, now, TEST_FRAMES, 0, model, False, scores)
        verdict = "confirmed" if foreseen else None
        zone = zone_at(self.hub.scene.setup(sensor).zones, MIDDLE)
        where = Where(MIDDLE, MIDDLE, 0.0, 100.0, 50.0, 1, 0, zone)
        self.publisher.publish(Onset(sensor, number, onset), test=True)
        if foreseen:
            self.publisher.publish(Provisional(sensor, number, gesture, 1.0, onset, now), test=True)
        self.publisher.publish(Gesture(sensor, number, gesture, 1.0, *answer, verdict, own, where), test=True)
        self.publisher.publish(Release(sensor, number, now), test=True)
        return {"sensor": sensor, "gesture": gesture, "sequence": sequence}

    async def view(self, connection: Connection, sensor: str, raw: bool = False) -> Reply:
        """One sensor as it is felt now."""
        found = self.views.view(sensor, raw=raw)
        if found is None:
            raise Refusal(f"no sensor {sensor!r}, expected one of {', '.join(self.hub.sequences()) or 'none'}")
        return found

    async def follow(self, connection: Connection, sensors: list[str], raw: bool = False) -> Reply:
        """Stream views of sensors, all events and the state from now on; a sensor may be named before it comes."""
        _not_yet(connection)
        self.views.follow(connection, sensors, raw=raw)
        return {"sensors": sensors}

    async def enrol(self, connection: Connection, name: str, sensor: str, examples: int = 3) -> Reply:
        """Learn a gesture from what is performed on a sensor; a line follows for each example, and one at the end."""
        await self.own.writable()
        snapshot = self.snapshot()
        silent = _heard(snapshot, sensor)[sensor].gate
        if silent is not None and silent.closed:
            raise Refusal(f"{sensor} is silent, since gates are closed: {', '.join(silent.closed)}; allow them first")
        _not_yet(connection)
        self.own.begin(connection, name, sensor, examples, snapshot.gestures)
        return {"name": name, "sensor": sensor, "examples": examples}

    async def gestures(self, connection: Connection) -> Reply:
        """The model's gestures that are in use, and the user's own."""
        snapshot = self.snapshot()
        return {"model": snapshot.models.active, "gestures": list(snapshot.gestures), "own": dict(snapshot.own)}

    async def forget(self, connection: Connection, name: str) -> Reply:
        """Forget a gesture of the user's own, and delete its examples from the file; not one that arms a sensor."""
        for setting, gesture in self.hub.scene.arming_gestures.items():
            if gesture == name:
                raise Refusal(f"{name!r} is {setting} in the configuration; take it out there and reload first")
        await self.own.forget(name)
        return {"forgotten": name}

    async def tap(self, connection: Connection) -> Reply:
        """Stream packets and events over this connection from now on."""
        _not_yet(connection)
        self.taps.join(connection)
        for gate in self.hub.listening(now := time.monotonic()):
            self.taps.publish(gate, time.time() - now)  # what holds where the tape begins
        return self._scene()

    async def flight(self, connection: Connection) -> ReplyStream:
        """Stream what the flight recorder holds, then `{"type":"end"}`."""
        if not self.taps.ring_bytes:
            raise Refusal("the flight recorder is off; set flight_recorder = MiB (or --flight-recorder) and restart")
        held = self.taps.flight()
        return ReplyStream(self._scene() | {"lines": len(held)}, chain(as_lines(held), (b'{"type":"end"}\n',)))

    def _scene(self) -> Reply:
        return scene(self.snapshot(), time.time_ns() - time.monotonic_ns(), self.own.gestures)


def _not_yet(connection: Connection) -> None:
    """Raises Refusal where a stream is on this connection already: its lines could not be told from another's."""
    if connection.streams:
        raise Refusal("this connection is a tap already, or another stream; open one more")


def _heard(snapshot: Snapshot, sensor: str | None) -> dict[str, Reading]:
    """The sensors that were heard, by name. Raises Refusal where the one that is asked for is none of them."""
    heard = {name: reading for name, reading in snapshot.sensors.items() if reading.source is not None}
    if sensor is not None and sensor not in heard:
        raise Refusal(f"no sensor {sensor!r}, expected one of {', '.join(heard) or 'none: no sensor was heard'}")
    return heard
