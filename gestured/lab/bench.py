"""What it costs here: replay in the process, start to ready, resident memory. Quote the ratios and the spread."""

import argparse
import importlib.util
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

import gestured
from gestured.client.engine import Engine
from gestured.core.errors import GesturedError
from gestured.core.events import Gesture, Unknown
from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.core.recognizer import Recognizer
from gestured.lab.online import play
from gestured.model.model import open_model
from gestured.simulator import Participant, SimulatedSensor, Take, generator, session

SECONDS = 300.0
REPEATS = 5
CHECKOUT = Path(gestured.__file__).parent.parent / "benchmarks"


def _take() -> Take:
    return session(Participant(901), SimulatedSensor.nominal(day=901), generator(901, 0xBE), SECONDS, 0.2)


def replay_speed(model: str, take: Take) -> list[float]:
    """Times real time, of each repetition: front end and recognition of a session in this process."""
    opened = open_model(model)
    found = []
    for _ in range(REPEATS + 1):
        recognizer = Recognizer(FrontEnd("bench", *take.frames.shape[1:]), opened)
        frames = [Frame(float(t), f) for t, f in zip(take.sensor_times, take.frames, strict=True)]
        start = time.process_time()
        for frame in frames:
            recognizer.push(frame)
        found.append(SECONDS / (time.process_time() - start))
    return found[1:]  # the first one warms up


def _answers(model: str, take: Take) -> int:
    """How many segments a replay in the process answers."""
    recognizer = Recognizer(FrontEnd("bench", *take.frames.shape[1:]), open_model(model))
    events = [
        e for t, f in zip(take.sensor_times, take.frames, strict=True) for e in recognizer.push(Frame(float(t), f))
    ]
    events += recognizer.flush(float(take.sensor_times[-1]) + 2)
    return sum(isinstance(e, Gesture | Unknown) for e in events)


def starts(model: str) -> tuple[list[float], list[float]]:
    """Seconds from exec to the ready line, and MiB of resident memory then."""
    seconds, memory = [], []
    for _ in range(REPEATS):
        start = time.monotonic()
        with Engine(model, 9, 9) as engine:
            seconds.append(time.monotonic() - start)
            memory.append(engine.resident() / 2**20)
    return seconds, memory


def run(args: argparse.Namespace) -> int:
    """`gestured-lab bench`."""
    take = _take()
    speeds = replay_speed(args.model, take)
    seconds, memory = starts(args.model)
    events, _, took = play(args.model, take, 1000.0)
    whole = len(events) == _answers(args.model, take)
    figures: dict[str, Any] = {
        "model": args.model,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}",
        "replay_times_real_time": _spread(speeds),
        "udp_times_real_time": round(SECONDS / took, 1),
        "udp_events_as_in_replay": whole,
        "start_to_ready_s": _spread(seconds),
        "resident_mib": _spread(memory),
    }
    beside = ordinary(args.model)
    if args.json:
        print(json.dumps(figures | {"beside_an_ordinary_script": beside}, indent=2))
    else:
        for name, value in figures.items():
            text = "median {median}, {least} to {most}".format(**value) if isinstance(value, dict) else value
            print(f"{name:<24} {text}")
        print("beside an ordinary script of python-osc and torch, which classifies each frame anew:")
        for row in beside or [{"figure": f"not measured: needs torch, and a checkout with {CHECKOUT.name}/"}]:
            print(f"  {row['figure']}: {row['ours']}, {row['against']}" if "ours" in row else f"  {row['figure']}")
    return 0


def ordinary(model: str) -> list[dict[str, Any]] | None:
    """What a user would otherwise write, beside gestured; None without torch or outside of a checkout."""
    if not CHECKOUT.is_dir() or importlib.util.find_spec("torch") is None:
        return None
    command = [sys.executable, "-m", CHECKOUT.name, "--model", model, "--json", "--only", "ordinary", "latency"]
    done = subprocess.run(command, cwd=CHECKOUT.parent, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise GesturedError(f"{CHECKOUT}: the comparison failed, see above")
    rows: list[dict[str, Any]] = json.loads(done.stdout)["rows"]
    return [row for row in rows if "ordinary" in row["against"]]


def _spread(values: list[float]) -> dict[str, float]:
    digits = 0 if median(values) > 1000 else 2
    return {
        "median": round(median(values), digits), "least": round(min(values), digits), "most": round(max(values), digits)
    }  # fmt: skip
