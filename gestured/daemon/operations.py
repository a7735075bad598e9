"""The verbs of the control socket: all that an operator may ask of a running daemon."""

import time
from collections.abc import Awaitable, Callable
from itertools import chain
from typing import Any

from gestured import __version__
from gestured.core.beside.reading import Reading
from gestured.core.events import Event, Gesture, Onset, Place, Provisional, Release, Where
from gestured.core.own import to_dict
from gestured.core.where import zone_at
from gestured.daemon.own import silent
from gestured.daemon.parts import Parts
from gestured.daemon.request import Connection, Refusal, Reply, ReplyStream, Verb
from gestured.daemon.status import status
from gestured.daemon.tap import as_lines
from gestured.daemon.values import SensorName

TEST_SENSORS = 64  # the most names that tests may use for sensors that were never heard
TEST_S = 0.4  # how long a made-up gesture took
TEST_FRAMES = 6  # touched frames of a made-up gesture, at 15 Hz
MIDDLE = Place(0.5, 0.5)  # the middle of a sensor, where a made-up gesture begins and ends


class Operations:
    """The verbs. Each checks everything before it changes anything."""

    def __init__(self, parts: Parts, reload: Callable[[], Awaitable[str | None]]) -> None:
        """`reload` reloads the daemon; it returns None, or why nothing has changed."""
        self._parts, self._reload = parts, reload
        self._tested: set[str] = set()  # names that tests have used for sensors that were never heard

    def verbs(self) -> dict[str, Verb]:
        """Name -> verb. This table is all that the control socket can do."""
        return {
            "status": Verb(self.status, changes=False),
            "reload": Verb(self.reload, slow=True),
            "recalibrate": Verb(self.recalibrate),
            "emit": Verb(self.emit),
            "follow": Verb(self.follow, changes=False),
            "enrol": Verb(self.enrol, slow=True),
            "gestures": Verb(self.gestures, changes=False),
            "forget": Verb(self.forget, slow=True),
            "tap": Verb(self.tap),
            "flight": Verb(self.flight),
        } | self._parts.gates.verbs()

    async def status(self, connection: Connection) -> Reply:
        """The state of the daemon, as `gesturectl status` shows it."""
        return status(self._parts)

    async def reload(self, connection: Connection) -> Reply:
        """Read configuration and models anew; if one of them is bad, nothing changes."""
        reason = await self._reload()
        if reason is not None:
            raise Refusal(f"{reason}; nothing has changed")
        ladder, waiting = self._parts.ladder, self._parts.awaiting_restart()
        return {"model": ladder.active, "awaiting_restart": waiting, "refused": ladder.refused}

    async def recalibrate(self, connection: Connection, sensor: SensorName | None = None) -> Reply:
        """Learn one idle sensor anew, or all. Refused while one of them is touched, since a hand is no baseline."""
        heard = self._heard(sensor)
        chosen = list(heard) if sensor is None else [sensor]
        if not chosen:
            raise Refusal("no sensor was heard so far")
        touched = [name for name in chosen if heard[name].touched]
        if touched:
            raise Refusal(f"touched: {', '.join(touched)}; take the hand off, and whatever lies there")
        self._parts.desk.take(self._parts.hub.restart(chosen, time.monotonic()))
        return {"sensors": chosen}

    async def emit(self, connection: Connection, gesture: str, sensor: SensorName | None = None) -> Reply:
        """Publish a made-up gesture on every output, marked as a test, with the sensor's next sequence and id."""
        hub, known, model = self._parts.hub, self._parts.gestures, self._parts.hub.scene.gestures
        sensor = sensor or "test"
        if gesture not in known:
            raise Refusal(f"no gesture {gesture!r} is in use, expected one of {', '.join(known)}")
        reading = self._heard().get(sensor)
        if reading is None:
            if sensor not in self._tested and len(self._tested) >= TEST_SENSORS:
                raise Refusal(f"tests used {TEST_SENSORS} names of sensors that are not there; use one of them again")
            self._tested.add(sensor)
        elif reading.touched or reading.contact is not None:
            raise Refusal(f"{sensor} is touched; a test would mix with what is being done there")
        sequence, number = hub.number(sensor)
        scores = {name: float(name == gesture) for name in model}
        now = time.monotonic()
        onset = now - TEST_S
        foreseen = hub.foreseen(sensor)
        answer = (sequence, onset, now, now, TEST_FRAMES, 0, self._parts.ladder.active, False, scores)
        where = Where(MIDDLE, MIDDLE, 0.0, 100.0, 50.0, 1, 0, zone_at(hub.scene.setup(sensor).zones, MIDDLE))
        verdict, own = "confirmed" if foreseen else None, gesture not in model
        events: list[Event] = [
            Onset(sensor, number, onset),
            *([Provisional(sensor, number, gesture, 1.0, onset, now)] if foreseen else []),
            Gesture(sensor, number, gesture, 1.0, *answer, verdict, own, where),
            Release(sensor, number, now),
        ]
        for event in events:
            self._parts.desk.publish(event, test=True)
        return {"sensor": sensor, "gesture": gesture, "sequence": sequence}

    async def follow(self, connection: Connection, sensors: list[SensorName], raw: bool = False) -> Reply:
        """Stream views of sensors, all events and the state from now on; a sensor may be named before it comes."""
        _not_yet(connection)
        self._parts.views.follow(connection, sensors, raw=raw)
        return {"sensors": sensors}

    async def enrol(self, connection: Connection, name: str, sensor: SensorName, examples: int = 3) -> Reply:
        """Learn a gesture from what is performed on a sensor; a line follows for each example, and one at the end."""
        await self._parts.own.writable()
        gate = self._heard(sensor)[sensor].gate
        if gate is not None and gate.closed:
            raise Refusal(silent(sensor, gate.closed))
        _not_yet(connection)
        self._parts.own.begin(connection, name, sensor, examples, self._parts.hub.scene.gestures)
        return {"name": name, "sensor": sensor, "examples": examples}

    async def gestures(self, connection: Connection) -> Reply:
        """The model's gestures that are in use, and the user's own."""
        parts = self._parts
        return {"model": parts.ladder.active, "gestures": list(parts.hub.scene.gestures), "own": parts.own.report()}

    async def forget(self, connection: Connection, name: str) -> Reply:
        """Forget an own gesture, and delete its examples from the file. Refused for one that arms a sensor."""
        for setting, gesture in self._parts.hub.scene.arming_gestures.items():
            if gesture == name:
                raise Refusal(f"{name!r} is {setting} in the configuration; take it out there and reload first")
        await self._parts.own.forget(name)
        return {"forgotten": name}

    async def tap(self, connection: Connection) -> Reply:
        """Stream packets and events over this connection from now on."""
        _not_yet(connection)
        self._parts.taps.join(connection)
        for gate in self._parts.hub.listening(now := time.monotonic()):
            self._parts.taps.publish(gate, time.time() - now)  # the state at the beginning of the tape
        return scene(self._parts)

    async def flight(self, connection: Connection) -> ReplyStream:
        """Stream what the flight recorder holds, then `{"type":"end"}`."""
        if not self._parts.taps.ring_bytes:
            raise Refusal("the flight recorder is off; set flight_recorder = MiB (or --flight-recorder) and restart")
        held, told = self._parts.taps.flight(), scene(self._parts)
        return told | {"lines": len(held)}, chain(as_lines(held, told["epoch_ns"]), (b'{"type":"end"}\n',))

    def _heard(self, sensor: str | None = None) -> dict[str, Reading]:
        """The sensors that were heard, by name. Raises Refusal if `sensor` is named and none of them."""
        heard = {name: one for name, one in self._parts.readings().items() if one.source is not None}
        if sensor is not None and sensor not in heard:
            raise Refusal(f"no sensor {sensor!r}, expected one of {', '.join(heard) or 'none: no sensor was heard'}")
        return heard


def scene(parts: Parts) -> dict[str, Any]:
    """What a recording must hold to be understood without this daemon; for `epoch_ns` see `Taps`."""
    model = parts.ladder.model
    return {
        "version": __version__,
        "instance": parts.instance,
        "epoch_ns": parts.taps.epoch_ns,
        "model": {"name": parts.ladder.active, "sha256": model.sha256, "rows": model.rows, "columns": model.columns},
        "gestures": list(parts.hub.scene.gestures),
        "own": to_dict(parts.own.gestures),
        "settings": parts.settings.model_dump(mode="json"),
    }


def _not_yet(connection: Connection) -> None:
    """Raises Refusal if the connection has a stream already, whose lines could not be told from those of another."""
    if connection.streams:
        raise Refusal("this connection is a tap already, or another stream; open one more")
