"""The one place where golden tapes meet today's code: whoever moves that code rewrites this file, and only this one.

`play` is the daemon's own pipeline, at times that are written down. `replay` is the same
tape as a file that `gesturectl replay` plays. `front_ends` is the path up to the segments, without a classifier.
"""

import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gestured.core.events import Cancelled, Event, Onset, Release
from gestured.core.frames import Frame, Segment
from gestured.core.front_end import Cut, FrontEnd
from gestured.core.stamping import Stamp
from gestured.core.wire import Addresses, Decoder
from gestured.daemon.metrics import Metrics
from gestured.daemon.pipeline import Pipeline
from gestured.daemon.settings import Settings
from gestured.model.ladder import Ladder
from gestured.record import replay as offline
from gestured.record import tape as mcap
from tests.golden.tape import Tape

Line = dict[str, Any]
MODEL = Path(__file__).parent / "models" / "cnn_lstm.onnx"


def open_model() -> Ladder:
    """The model that the tapes are pinned to. However slow this machine is, no run is too slow."""
    return Ladder([MODEL], slow_s=math.inf)


def play(tape: Tape, model: Ladder) -> list[Line]:
    """What the daemon publishes, each event with the time at which it does; then its counts and its sensors."""
    lines: list[Line] = []
    now = 0.0
    settings = Settings.model_validate(dict(tape.settings))
    metrics = Metrics()
    pipeline = Pipeline(settings, model, metrics, lambda event: lines.append({"at": now} | _line(event)))
    for now, waiting in tape.steps():
        if waiting is None:
            pipeline.tick(now)
        else:
            pipeline.receive(waiting, now)
    now = tape.end_ns / 1e9
    states = pipeline.states(now)
    for sensor in pipeline.sensors.values():
        pipeline.flush(sensor, now)
    counts = {
        "type": "Counts",
        "dropped": {reason: count for (reason,), count in sorted(metrics.dropped.values.items())},
        "frames": {f"{name} {result}": n for (name, result), n in sorted(metrics.frames.values.items())},
        "implausible": metrics.implausible.total(),
        "internal_errors": metrics.internal_errors.total(),
    }
    return [*lines, counts, *(_sensor(pipeline, name, state) for name, state in sorted(states.items()))]


def _sensor(pipeline: Pipeline, name: str, state: str) -> Line:
    line: Line = {"type": "Sensor", "sensor": name, "state": state}
    if (sensor := pipeline.sensors.get(name)) is not None:
        front_end = sensor.recognizer.front_end
        line |= {"noise": front_end.noise, "bad_taxels": front_end.bad_taxels, "interval_s": front_end.interval_s}
        line |= {"lost": sensor.lost, "sequence": sensor.recognizer.sequence, "segments": front_end.segments}
    return line


def _line(event: Event) -> Line:
    return {"type": type(event).__name__} | asdict(event)


def replay(tape: Tape, model: Ladder) -> list[Line]:
    """The events of the tape as `gesturectl replay` has them; without the time at which they were published."""
    settings = Settings.model_validate(dict(tape.settings))
    used = [g for g in model.gestures if settings.gestures is None or g in settings.gestures]
    scene = {
        "gestures": used,
        "settings": settings.model_dump(mode="json"),
        "model": {"name": model.name, "sha256": "", "rows": model.rows, "columns": model.columns},
    }
    packets = tuple(mcap.Packet(p.t_ns, p.source, p.data) for p in tape.packets)
    player = offline.Replay(mcap.Tape(scene, packets, (), True), offline.Scene(scene), model)
    return [_line(event) for event in player.events()]


Found = Onset | Cut | Cancelled | Release


def front_ends(tape: Tape) -> Iterator[tuple[FrontEnd, Stamp, list[Found]]]:
    """Each sensor's front end after each of its frames, with the frame's stamp, and what the front end found.

    Whoever sends may feed every sensor, and touches are kept. A dropped frame is passed over, but its stamp is given.
    """
    settings = Settings.model_validate(dict(tape.settings))
    scene = offline.Scene(
        {
            "gestures": ["double_tap"] if settings.gestures is None else settings.gestures,
            "settings": settings.model_dump(mode="json"),
            "model": {"rows": 9, "columns": 9},
        }
    )
    addresses = Addresses(settings.addresses.pressure, settings.addresses.trajectory)
    decoder = Decoder(addresses, scene.grid, keep_touches=True)
    sensors: dict[str, tuple[Any, FrontEnd]] = {}
    for now, waiting in tape.steps():
        arrived: dict[str, list[Any]] = {}
        for packet, source in waiting or ():
            for arrival in decoder.decode(packet, source)[0]:
                arrived.setdefault(arrival.sensor, []).append(arrival)
        for name, arrivals in arrived.items():
            if name not in sensors:
                sensors[name] = scene.stamper(name), scene.front_end(name)
            stamper, front_end = sensors[name]
            for arrival, stamp in zip(arrivals, stamper.stamp(arrivals, now), strict=True):
                found: list[Found] = []
                if not stamp.dropped:
                    if stamp.restarted:
                        found += front_end.reset()
                    found += front_end.push(Frame(stamp.t, arrival.values, arrival.touches, stamp.lost))
                yield front_end, stamp, found


def window(segment: Segment, model: Ladder) -> Any:
    """A segment as the model takes it."""
    metadata: Any = model.model
    return metadata.metadata.window.apply(segment)
