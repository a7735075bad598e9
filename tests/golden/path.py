"""The one place where golden tapes meet today's code: whoever moves that code rewrites this file, and only this one.

`play` is the daemon's own hub, at times that are written down. `replay` is the same tape as a file that `gesturectl
replay` plays. `front_ends` is the path up to the segments, without a classifier.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import MISSING, asdict, fields
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from gestured.core.beside.reading import Reading
from gestured.core.events import Cancelled, Event, Gesture, Onset, Release, Unknown
from gestured.core.facts import Arrived, Changed, Decided, Dropped, Fact, Fault, Taken
from gestured.core.frames import Frame, Segment
from gestured.core.front_end import Ended, Found, FrontEnd, Opened, Void
from gestured.core.hub import Hub
from gestured.core.sensor import Sensor
from gestured.core.stamping import Stamp, Stamper
from gestured.core.wire import Decoder
from gestured.daemon.asked import scene_of
from gestured.daemon.settings import Settings
from gestured.model.ladder import Ladder
from gestured.record import tape as mcap
from gestured.record.replay import Mute, Replay, maker, opened
from tests.golden.tape import Packet, Tape, arrived

Line = dict[str, Any]
COUNTED = {"taken": "ok", "lost": "lost", "duplicates": "duplicate", "late": "late"}  # as the metrics call them
OUTSIDE = {"listen", "publish", "socket", "control", "gates", "metrics", "model", "fallback"}  # settings of no tape
MODEL = Path(__file__).parent / "models" / "cnn_lstm.onnx"


def open_model() -> Ladder:
    """The model that the tapes are pinned to. However slow this machine is, no run is too slow."""
    return Ladder([MODEL], slow_s=math.inf)


def play(tape: Tape, model: Ladder) -> list[Line]:
    """What the daemon publishes, each event with the time at which it does; then its counts and its sensors."""
    lines: list[Line] = []
    frames: Counter[str] = Counter()
    dropped: Counter[str] = Counter()
    implausible = faults = 0
    hub = Hub(scene_of(Settings.model_validate(dict(tape.settings)), model), model)

    def take(facts: list[Fact], now: float) -> None:
        nonlocal implausible, faults
        for fact in facts:
            match fact:
                case Arrived():
                    implausible += fact.implausible
                    for sensor, result in product(fact.sensors, ("taken", "lost", "duplicates", "late")):
                        frames[f"{sensor} {COUNTED[result]}"] += getattr(fact, result)
                case Dropped():
                    dropped[fact.reason] += 1
                case Fault():
                    faults += 1
                case Decided() | Taken() | Changed():
                    pass
                case _:
                    lines.append({"at": now} | as_line(fact))

    for now, waiting in tape.steps():
        take(hub.tick(now) if waiting is None else hub.receive(waiting, now), now)
    end = tape.end_ns / 1e9
    readings = hub.readings(end)
    take(hub.flush(end), end)
    after = hub.readings(end)
    counts = {
        "type": "Counts",
        "dropped": dict(sorted(dropped.items())),
        "frames": {name: count for name, count in sorted(frames.items()) if count},
        "implausible": implausible,
        "internal_errors": faults,
    }
    return [*lines, counts, *(_sensor(name, readings[name].state, after[name]) for name in sorted(readings))]


def _sensor(name: str, state: str, reading: Reading) -> Line:
    line: Line = {"type": "Sensor", "sensor": name, "state": state}
    if reading.source is not None:
        line |= {"noise": reading.noise, "bad_taxels": reading.bad_taxels, "interval_s": reading.interval_s}
        line |= {"lost": reading.lost, "sequence": reading.sequence, "segments": reading.segments}
    return line


def as_line(event: Event) -> Line:
    """An event with the keys that the tapes know. What has a default was added later, and no tape knows it."""
    said = asdict(event)
    if isinstance(event, Gesture | Unknown):
        where = said["where"]
        assert all(0 <= where[end][axis] <= 1 for end in ("start", "end") for axis in "xy") and where["zone"] is None
    if isinstance(event, Gesture | Unknown | Cancelled):
        assert said["provisional"] is None  # nobody asks for these
    if isinstance(event, Gesture):
        assert said["own"] is False
    if isinstance(event, Unknown):
        assert said["reason"] in ("confidence", "hole", "rate") and not said["gates"]
    known = [one.name for one in fields(event) if one.default is one.default_factory is MISSING]
    return {"type": type(event).__name__} | {name: said[name] for name in known}


def replay(tape: Tape, model: Ladder) -> list[Line]:
    """The events of the tape as `gesturectl replay` has them; without the time at which they were published."""
    settings = Settings.model_validate(dict(tape.settings))
    told = {
        "gestures": scene_of(settings, model).gestures,
        "settings": settings.model_dump(mode="json"),
        "model": {"name": model.name, "sha256": "", "rows": model.rows, "columns": model.columns},
    }
    packets = tuple(mcap.Packet(p.t_ns, p.source, p.data) for p in tape.packets)
    player = Replay(mcap.Tape(told, packets, (), True), maker(told).scene, model)
    return [as_line(event) for event in player.events()]


def recorded(file: Path) -> Tape:
    """What `gesturectl record` has written, as a golden tape."""
    found, made = opened(file)
    settings = {key: value for key, value in found.scene["settings"].items() if key not in OUTSIDE}
    packets = (Packet(p.t_ns, tuple(p.source), p.data) for p in found.packets)
    return arrived(file.stem, f"recorded with {made.models[0]}", packets, settings)


def front_ends(tape: Tape) -> Iterator[tuple[str, FrontEnd, Stamp, list[tuple[int, Found]]]]:
    """Each sensor's front end after each of its frames, with the frame's stamp, and what it found, with contacts' ids.

    Whoever sends may feed every sensor. A dropped frame is passed over, but its stamp is given.
    """
    settings = Settings.model_validate(dict(tape.settings))
    gestures = ("double_tap",) if settings.gestures is None else settings.gestures
    scene = scene_of(settings, SimpleNamespace(gestures_in_use=lambda _: gestures, rows=9, columns=9))  # type: ignore[arg-type]
    decoder = Decoder(scene.addresses, scene.grid_of, keep_touches=True)
    sensors: dict[str, tuple[Stamper, FrontEnd]] = {}
    numbers: Counter[str] = Counter()
    for now, waiting in tape.steps():
        arrived: dict[str, list[Any]] = {}
        for packet, source in waiting or ():
            for arrival in decoder.decode(packet, source)[0]:
                arrived.setdefault(arrival.sensor, []).append(arrival)
        for name, arrivals in arrived.items():
            if name not in sensors:
                sensors[name] = Stamper(scene.clock_of(name)), Sensor(name, scene, Mute(scene.gestures)).front_end
            stamper, front_end = sensors[name]
            for arrival, stamp in zip(arrivals, stamper.stamp(arrivals, now), strict=True):
                found: list[tuple[int, Found]] = []
                if not stamp.dropped:
                    each = front_end.reset() if stamp.restarted else []
                    each += front_end.push(Frame(stamp.t, arrival.values, arrival.touches, stamp.lost))
                    for one in each:
                        numbers[name] += isinstance(one, Opened)
                        if not isinstance(one, Segment):
                            found.append((numbers[name], one))
                yield name, front_end, stamp, found


def contact_line(sensor: str, number: int, found: Opened | Void | Ended) -> Line:
    """What a front end found of a contact, as the event that is made of it."""
    if isinstance(found, Opened):
        return as_line(Onset(sensor, number, found.onset))
    if isinstance(found, Void):
        return as_line(Cancelled(sensor, number, found.reason))
    return as_line(Release(sensor, number, found.offset))


def window(segment: Segment, model: Ladder) -> Any:
    """A segment as the model takes it."""
    return model.model.metadata.window.apply(segment)
