"""The whole path in one process: frames -> front end -> window -> model -> events; and what to send along it."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.classifier import Classifier
from gestured.core.events import Cancelled, Event, Gesture, Onset, Release, Unknown
from gestured.core.mounting import Mounting
from gestured.core.scene import Scene, Setup
from gestured.core.sensor import Sensor
from gestured.model.embedded import Embedded
from gestured.simulator import GESTURES, Participant, SimulatedSensor, generator, gesture_take

Array = NDArray[Any]
FLUSH_AFTER_S = 2.0
SIGNAL, NOISE, IDLE_LEVEL = 600.0, 2.0, 300.0  # counts of a firm finger, of noise, of an idle taxel
# The largest numbers of float32, one that its square overflows, ordinary ones, two denormals, and both zeros.
FINITE = (float(np.finfo(np.float32).max), 1e30, 1.0, 1e-40, 1e-45, 0.0, -0.0, -1e-40, -1.0, -1e30)


@dataclass(frozen=True, slots=True)
class Series:
    """What a sensor sends: (n,) times in seconds, (n, R, C) raw counts."""

    times: Array
    frames: Array


def simulated_series(count: int, kinds: Sequence[str] = GESTURES, seed: int = 41) -> Iterator[tuple[str, Series]]:
    """So many simulated gestures, or other kinds, one after the other, a new person and sensor after each round."""
    for k in range(count):
        kind, person = kinds[k % len(kinds)], 7000 + seed * 100 + k // len(kinds)
        take = gesture_take(kind, Participant(person), SimulatedSensor.nominal(day=person), generator(seed, k))
        yield kind, Series(take.sensor_times, take.frames.astype(np.float64))


def events(stream: Series, classifier: Classifier, mounting: Mounting | None = None) -> list[Event]:
    """What a recogniser makes of it, by the front door."""
    mounted = {"stability": Setup(mounting=mounting or Mounting())}
    scene = Scene(classifier.gestures, stream.frames.shape[1:], mounted)
    recogniser, found = Embedded(Sensor("stability", scene, classifier), classifier.gestures), []
    for t, values in zip(stream.times, stream.frames, strict=True):
        found += recogniser.push(float(t), values)
    return found + recogniser.flush(float(stream.times[-1]) + FLUSH_AFTER_S)


def labels(found: list[Event]) -> tuple[str, ...]:
    """What was answered, in order: a gesture, `unknown`, or why it was cancelled."""
    return tuple(
        event.gesture if isinstance(event, Gesture) else "unknown" if isinstance(event, Unknown) else event.reason
        for event in found
        if isinstance(event, Gesture | Unknown | Cancelled)
    )


def fault(found: list[Event]) -> str:
    """What breaks the contract in it: each onset has one answer and one release, all numbers are finite; else ''."""
    order = [event for event in found if not isinstance(event, Release)]
    releases = [event.id for event in found if isinstance(event, Release)]
    onsets = [event.id for event in found if isinstance(event, Onset)]
    if releases != onsets or [type(event) is Onset for event in order] != [True, False] * len(onsets):
        return "an onset without one answer and one release"
    for event in found:
        if isinstance(event, Gesture | Unknown):
            values = [event.confidence, event.onset, event.offset, *event.scores.values()]
            if not all(map(math.isfinite, values)) or abs(sum(event.scores.values()) - 1.0) > 1e-3:
                return "scores that are no probabilities"
    return ""


def finger(row: float, column: float, rows: int, columns: int, width: float) -> Array:
    """(R, C) counts of a finger at a row and a column, as wide as `width` taxels."""
    down, right = np.ogrid[:rows, :columns]
    return np.asarray(SIGNAL * np.exp(-((down - row) ** 2 + (right - column) ** 2) / (2 * width**2)))


def swipes(
    count: int, *, shape: tuple[int, int] = (9, 9), rate: float = 15.0, noise: float = NOISE, level: float = IDLE_LEVEL
) -> tuple[Series, tuple[float, ...]]:
    """So many swipes of 0.7 s to the right, 3.7 s apart, the first at 1.5 s; and when they begin."""
    rng = np.random.default_rng(len(shape) * count)
    times = np.arange(int(count * 3.7 * rate)) / rate
    share = (times % 3.7 - 1.5) / 0.7
    frames = level + noise * rng.standard_normal((len(times), *shape))
    size = max(min(shape) / 9, 0.6)
    for k in np.flatnonzero((share >= 0) & (share <= 1)):
        frames[k] += finger((shape[0] - 1) / 2, (0.1 + 0.8 * share[k]) * (shape[1] - 1), *shape, size)
    return Series(times, frames), tuple(1.5 + 3.7 * k for k in range(count))
