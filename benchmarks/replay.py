"""How much faster than real time a session is played: in this process, and over UDP to a daemon."""

import time

import numpy as np

from benchmarks.timing import Row
from benchmarks.traffic import touched
from gestured.core.events import Gesture, Unknown
from gestured.core.frames import Frame
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.lab.online import play
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.simulator import Take

SECONDS = 300.0
REPEATS = 5
FASTER = 200.0  # times real time; a daemon that is ended before it has served all frames gives fewer answers


def replay(model: str) -> Row:
    """How much faster than real time one sensor at 15 Hz is recognised, and whether a daemon gives the same answers."""
    take, opened = touched(60, SECONDS), open_model(model)
    speeds, answers = [], []
    for _ in range(REPEATS + 1):
        start = time.process_time()
        answers = _answers(take, opened)
        speeds.append(SECONDS / (time.process_time() - start))
    speeds = speeds[1:]  # the first run warms up
    heard = [event.get("gesture") for event in play(model, take, FASTER)[0]]
    same = "the same" if heard == answers else f"{len(heard)}, and others,"
    return Row(
        f"replay of {SECONDS / 60:g} minutes of one sensor at 15 Hz, {len(answers)} answers",
        f"{np.median(speeds):.0f} ({min(speeds):.0f} to {max(speeds):.0f}) times real time",
        f"over UDP at {FASTER:g} times real time: {same} answers",
        "",
        "the same answers",
        heard == answers,
    )


def _answers(take: Take, model: Model) -> list[str | None]:
    """The gesture of each answer, or None for unknown."""
    recognizer = Sensor("bench", Scene(model.gestures, take.frames.shape[1:]), model)
    frames = zip(take.sensor_times, take.frames, strict=True)
    events = [event for t, values in frames for event in recognizer.push(Frame(float(t), values))]
    events += recognizer.flush(float(take.sensor_times[-1]) + 2)
    return [getattr(event, "gesture", None) for event in events if isinstance(event, Gesture | Unknown)]
