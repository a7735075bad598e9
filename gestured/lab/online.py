"""Continuous sessions over UDP to a real daemon; its events from the Unix socket, scored against what was performed."""

import argparse
import json
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from statistics import median
from typing import Any

import numpy as np

from gestured.client.engine import Engine
from gestured.client.sensor import Form, Sensor
from gestured.client.stream import Stream
from gestured.core.errors import GesturedError
from gestured.core.frames import Frame
from gestured.lab.progress import progress
from gestured.record.judge import Outcome, Performed, Tally
from gestured.simulator import Participant, SimulatedSensor, Take, generator, session

SESSION_S = 120.0
NON_GESTURE_SHARE = 0.2  # share of what is performed


def takes(minutes: float, idle_minutes: float, seed: int) -> Iterator[tuple[str, Take]]:
    """Sessions of one new participant each on the nominal sensor, then one of an untouched sensor."""
    for n in range(round(minutes * 60 / SESSION_S)):
        person = seed + n
        rng = generator(person, 0x0E)
        yield (
            "session",
            session(Participant(person), SimulatedSensor.nominal(day=person), rng, SESSION_S, NON_GESTURE_SHARE),
        )
    if idle_minutes > 0:
        rng = generator(seed, 0x1D)
        yield "idle", session(Participant(seed), SimulatedSensor.nominal(day=seed), rng, idle_minutes * 60, kinds=[])


def play(model: str, take: Take, speed: float) -> tuple[list[dict[str, Any]], float, float]:
    """Send a take `speed` times as fast as it was to a daemon of its own.

    Returns its events, the epoch time of the sensor's time 0, and how many seconds the sending took. The sensor's clock
    rules: the daemon's first stamp is the arrival of the first frame, and times after it are the sensor's.
    """
    rows, columns = take.frames.shape[1:]
    heard: list[dict[str, Any]] = []
    with Engine(model, rows, columns, "--clock", "sensor") as engine:
        with (
            closing(Stream(engine.socket, {"types": ["gesture", "unknown"]})) as stream,
            closing(Sensor(engine.listen, Form("lab"))) as sensor,
        ):
            reader = threading.Thread(target=lambda: heard.extend(stream), daemon=True)
            reader.start()
            epoch, start = time.time(), time.monotonic()
            first = float(take.sensor_times[0])
            for n in range(len(take.frames)):
                t = float(take.sensor_times[n])
                wait = start + (t - first) / speed - time.monotonic()
                if wait > 0.002:  # in small bursts: a sleep for each frame would be the slowest part
                    time.sleep(wait)
                sensor.socket.send(sensor.form.packet(Frame(t, take.frames[n]), int(take.counter[n]), epoch + t))
            took = time.monotonic() - start
            engine.close()  # it flushes what is open, and the stream ends
            reader.join(10)
    if sensor.unheard:
        raise GesturedError(f"{sensor.unheard} packets were refused by the daemon's port")
    return [e for e in heard if e["type"] in ("gesture", "unknown")], epoch - first, took


def tallied(take: Take, zero: float, events: list[dict[str, Any]]) -> tuple[Tally, list[Outcome]]:
    """The tally of a take whose time 0 was at `zero` (epoch seconds), and what became of each gesture that was told."""
    tally = Tally()
    for act in take.events:
        tally.begin(Performed(act.label, act.kind, zero + act.onset_s, zero + act.offset_s))
    outcomes = [outcome for event in events if (outcome := tally.hear(event, event["decided"]))]
    tally.settle(float("inf"))
    return tally, outcomes


def run(args: argparse.Namespace) -> int:
    """Run `gestured-lab online`: print its figures."""
    counts: Counter[str] = Counter()
    wrong: Counter[str] = Counter()
    waits: list[float] = []
    minutes, idle_false, idle_minutes, real_s, took_s = 0.0, 0, 0.0, 0.0, 0.0
    todo = list(takes(args.minutes, args.idle_minutes, args.seed))
    for what, take in progress(todo, len(todo), "sessions"):
        events, zero, took = play(args.model, take, args.speed)
        length = float(take.sensor_times[-1] - take.sensor_times[0])
        real_s, took_s = real_s + length, took_s + took
        published = [e for e in events if e["type"] == "gesture"]
        if what == "idle":
            idle_minutes, idle_false = idle_minutes + length / 60, idle_false + len(published)
            continue
        minutes += length / 60
        tally, outcomes = tallied(take, zero, events)
        for outcome in outcomes:
            if outcome.event is not None and outcome.verdict in ("wrong", "false"):
                act = outcome.performed
                done = "nothing" if act is None else act.label if outcome.verdict == "wrong" else act.kind
                wrong[f"{done} -> {outcome.event['gesture']}"] += 1
        counts.update(tally.counts)
        waits += tally.latencies
    gestures = counts["right"] + counts["wrong"] + counts["missed"]
    figures = {
        "model": args.model, "data": "simulated: gestured's own simulator, nominal sensor, new participants",
        "minutes": round(minutes, 1), "gestures": gestures,
        "right": round(counts["right"] / max(gestures, 1), 4), "wrong": round(counts["wrong"] / max(gestures, 1), 4),
        "missed": round(counts["missed"] / max(gestures, 1), 4),
        "false_per_minute": round(counts["false"] / max(minutes, 1e-9), 3), "non_gestures_rejected": counts["rejected"],
        "idle_minutes": round(idle_minutes, 1), "idle_false": idle_false,
        "decided_after_s_median": round(median(waits), 3) if waits else None,
        "decided_after_s_p95": round(float(np.quantile(waits, 0.95)), 3) if waits else None,
        "times_real_time": round(real_s / took_s, 1), "errors": dict(wrong.most_common(12)),
    }  # fmt: skip
    if args.json:
        print(json.dumps(figures, indent=2))
    else:
        for name, value in figures.items():
            print(f"{name:<24} {value}")
    return 0
