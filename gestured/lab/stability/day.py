"""A day at 15 Hz: contacts, a temperature that swings, and what a front end holds at its end."""

import hashlib
import math
import pickle
from collections.abc import Iterator

import numpy as np

from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.core.scene import Setup
from gestured.lab.everyday.stretches import Stretch
from gestured.lab.table import Table, Value
from gestured.record.judge import Performed
from gestured.simulator import GESTURES, Participant, SimulatedSensor, gesture_take
from gestured.simulator.people import generator

DAY_S, HOUR_S = 86_400.0, 3600.0
FIRST = 8_000_000  # of the people; no model learned from them
SHOWN = 16  # digits of a SHA-256
RUNS = ("the first run", "the second")


def day(quick: bool) -> Stretch:
    """A day at 15 Hz (quick: an hour) whose temperature swings by fifty noise units, a gesture every ten minutes."""
    sensor, rng = SimulatedSensor.nominal(day=FIRST), generator(FIRST, 0xDA4)
    noise, hours = sensor.gain * sensor.noise, 1 if quick else 24
    takes = [gesture_take(name, Participant(FIRST + k), sensor, rng) for k, name in enumerate(GESTURES)]
    touched = [one - np.median(one, axis=0) for one in (take.frames.astype(np.float64) for take in takes)]
    meant: list[Performed] = []
    for k in range(6 * hours):
        act, at = takes[k % len(takes)].events[0], 600.0 * k + 300.0
        meant.append(Performed(act.label, act.kind, at + act.onset_s, at + act.offset_s))

    def frames() -> Iterator[Frame]:
        for k in range(6 * hours):
            t = 600.0 * k + np.arange(9000) / sensor.rate_hz
            block = noise * rng.standard_normal((9000, sensor.rows, sensor.columns))
            block += 300.0 + 50.0 * noise * np.sin(2 * math.pi * t / DAY_S)[:, None, None]
            one = touched[k % len(touched)]
            block[4500 : 4500 + len(one)] += one
            yield from map(Frame, t.tolist(), np.rint(block))

    return Stretch("day", "one", frames(), Setup(grid=(sensor.rows, sensor.columns)), meant, [])


def day_table(quick: bool) -> Table:
    """The same day twice through a front end: how much it holds, and whether it holds the same to the last bit."""
    return Table(
        f"A front end after {'an hour' if quick else '24 hours'} at 15 Hz",
        ("the same day", "frames", "bytes held after an hour", "most, at any hour's end", "digest of all at its end"),
        [(title, *_run(day(quick))) for title in RUNS],
        (
            "A simulated sensor whose temperature swings by 50 noise units, with a gesture every ten minutes; the row",
            "of 24 hours above has what was decided, and for how long no gesture could begin. Held is all that",
            "Python's pickle finds: the state of every filter, and what was learned of every taxel.",
        ),
    )


def _run(life: Stretch) -> tuple[Value, ...]:
    front_end, count, sizes = FrontEnd(*life.setup.grid or (9, 9)), 0, list[int]()
    for frame in life.frames:
        front_end.push(frame)
        count += 1
        if count % round(15 * HOUR_S) == 0:
            sizes.append(len(pickle.dumps(front_end)))
    return count, sizes[0], max(sizes), hashlib.sha256(pickle.dumps(front_end)).hexdigest()[:SHOWN]
