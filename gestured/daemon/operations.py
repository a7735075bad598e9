"""What an operator may ask of a running daemon: the table of the control socket's verbs."""

import asyncio
import time
from collections.abc import Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any

from gestured import __version__
from gestured.core.events import Gesture, Onset, Release
from gestured.core.wire import is_sensor
from gestured.daemon.control import Connection
from gestured.daemon.request import Answer, Parameter, Refusal, Stream, Verb
from gestured.daemon.status import status
from gestured.daemon.tap import as_lines
from gestured.model.model import open_apart

if TYPE_CHECKING:
    from gestured.daemon.service import Service

TEST_SENSORS = 64  # names of sensors that are not there
TEST_S = 0.4  # how long a made-up gesture took

SENSOR = Parameter(
    (str, type(None)), "a sensor's name, 1 to 64 of A-Z a-z 0-9 _ -", check=lambda name: name is None or is_sensor(name)
)
LABEL = Parameter(str, "a gesture's name", required=True)
MODEL = Parameter((str, type(None)), "a model's path or name, or null to end it", required=True)


def verbs(service: "Service") -> dict[str, Verb]:
    """Name -> verb. This table is all that the control socket can do."""
    do = Operations(service)
    return {
        "status": Verb(do.status, changes=False),
        "reload": Verb(do.reload, slow=True),
        "recalibrate": Verb(do.recalibrate, {"sensor": SENSOR}),
        "emit": Verb(do.emit, {"gesture": LABEL, "sensor": SENSOR}),
        "shadow": Verb(do.shadow, {"model": MODEL}, slow=True),
        "tap": Verb(do.tap),
        "flight": Verb(do.flight),
    }


class Operations:
    """The verbs. Each checks everything before it changes anything."""

    def __init__(self, service: "Service") -> None:
        self._service = service
        self._tested: set[str] = set()  # names of sensors that were not there

    async def status(self, connection: Connection) -> Answer:
        """How the daemon is."""
        return status(self._service)

    async def reload(self, connection: Connection) -> Answer:
        """Read configuration and model anew; the old ones stay where the new ones are bad."""
        reason = await self._service.reload()
        if reason is not None:
            raise Refusal(f"{reason}; nothing has changed")
        return {"model": self._service.pipeline.watched.ladder.active}

    async def recalibrate(self, connection: Connection, sensor: str | None = None) -> Answer:
        """Learn the idle sensor anew: one, or all. Refused while one of them is touched: a hand is no baseline."""
        sensors = self._service.pipeline.sensors
        if sensor is not None and sensor not in sensors:
            raise Refusal(f"no sensor {sensor!r}, expected one of {', '.join(sensors) or 'none: no sensor was heard'}")
        chosen = list(sensors.values()) if sensor is None else [sensors[sensor]]
        if not chosen:
            raise Refusal("no sensor was heard so far")
        touched = [one.name for one in chosen if one.recognizer.front_end.touched]
        if touched:
            raise Refusal(f"touched: {', '.join(touched)}; take the hand off, and whatever lies there")
        for one in chosen:
            self._service.pipeline.restart(one)
        return {"sensors": [one.name for one in chosen]}

    async def emit(self, connection: Connection, gesture: str, sensor: str | None = None) -> Answer:
        """A made-up gesture through every output, marked as a test; it takes the sensor's next numbers."""
        pipeline, sensor = self._service.pipeline, sensor or "test"
        if gesture not in pipeline.gestures:
            raise Refusal(f"no gesture {gesture!r} is in use, expected one of {', '.join(pipeline.gestures)}")
        now = time.monotonic()
        live = pipeline.sensors.get(sensor)
        if live is None:
            if sensor not in self._tested and len(self._tested) >= TEST_SENSORS:
                raise Refusal(f"tests used {TEST_SENSORS} names of sensors that are not there; use one of them again")
            self._tested.add(sensor)
        elif live.recognizer.front_end.touched or live.open is not None:
            raise Refusal(f"{sensor} is touched; a test would mix with what is being done there")
        sequence, number = pipeline.number(sensor)
        scores = {name: float(name == gesture) for name in pipeline.gestures}
        onset, frames = now - TEST_S, round(TEST_S * 15)
        model = pipeline.watched.ladder.active
        for event in (
            Onset(sensor, number, onset),
            Gesture(sensor, number, gesture, 1.0, sequence, onset, now, now, frames, 0, model, False, scores),
            Release(sensor, number, now),
        ):
            self._service.emit(event, test=True)
        return {"sensor": sensor, "gesture": gesture, "sequence": sequence}

    async def shadow(self, connection: Connection, model: str | None) -> Answer:
        """Run a candidate beside the active model; null ends it. Gives what the last one was worth."""
        watched = self._service.pipeline.watched
        if model is None:
            last, watched.shadow = watched.shadow, None
            return {"shadow": await asyncio.to_thread(last.finish) if last else None}
        candidate = await asyncio.to_thread(open_apart, model)
        shadow = self._service.pipeline.watched.compare(candidate)  # not `watched`: a reload may have come in between
        return {"shadow": shadow.report()}

    async def tap(self, connection: Connection) -> Answer:
        """Stream packets and events over this connection from now on."""
        if connection.tap:
            raise Refusal("this connection is a tap already")
        self._service.tap(connection)
        return self.scene()

    async def flight(self, connection: Connection) -> Stream:
        """Stream what the flight recorder holds, then `{"type":"end"}`."""
        taps = self._service.taps
        if not taps.ring_bytes:
            raise Refusal("the flight recorder is off; set flight_recorder = MiB (or --flight-recorder) and restart")
        held = taps.flight()
        return Stream(self.scene() | {"lines": len(held)}, chain(as_lines(held), (b'{"type":"end"}\n',)))

    def scene(self) -> dict[str, Any]:
        """What a recording must know to be understood without this daemon."""
        pipeline = self._service.pipeline
        model: Any = pipeline.watched.ladder.model
        settings: Mapping[str, Any] = self._service.settings.model_dump(mode="json")
        return {
            "version": __version__,
            "instance": self._service.health.instance,
            "epoch_ns": time.time_ns() - time.monotonic_ns(),
            "model": {
                "name": pipeline.watched.ladder.active,
                "sha256": model.sha256,
                "rows": model.rows,
                "columns": model.columns,
            },
            "gestures": list(pipeline.gestures),
            "settings": settings,
        }
