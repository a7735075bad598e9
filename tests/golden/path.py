"""The one place where golden tapes meet today's code: whoever moves that code rewrites this file, and only this one.

`play` is the daemon's own hub, at times that are written down. `replay` is the same tape as a file that `gesturectl
replay` plays.
"""

import math
from collections import Counter
from dataclasses import MISSING, asdict, fields
from itertools import product
from pathlib import Path
from typing import Any

from gestured.core.beside.reading import Reading
from gestured.core.events import Cancelled, Event, Gesture, Unknown
from gestured.core.facts import Arrived, Changed, Decided, Dropped, Fact, Fault, Taken
from gestured.core.hub import Hub
from gestured.daemon.asked import scene_of
from gestured.daemon.settings import Settings
from gestured.model.ladder import Ladder
from gestured.record import tape as mcap
from gestured.record.replay import Replay, maker, opened
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
