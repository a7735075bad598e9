"""The price of denormals: numbers so small that a processor may take many times as long for them.

No sensor sends them; they stand for what a filter or a net could fade to.
"""

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.lab.stability.made import IDLE_LEVEL, NOISE
from gestured.lab.stability.path import Array
from gestured.lab.stability.ways import WindowList, by_onnxruntime, difference, inputs_of
from gestured.lab.table import Table, Value
from gestured.model.shipped import LADDER, shipped

DENORMAL = 1e-41  # of the peak; float32's least normal number is 1.2e-38
COUNTS = {"float32": 1e-42, "float64": 1e-312}  # a gain that leaves every count denormal
IDLE_FRAMES = 300
ROUNDS = 9  # pairs


def denormals_table(windows: WindowList) -> Table:
    """Models on windows whose zeros became denormals, and the front end on denormal counts; each in turns."""
    rows: list[tuple[Value, ...]] = []
    small = [np.where(window > 0, window, np.float32(DENORMAL)).astype(np.float32) for window in windows]
    for name in LADDER:
        run = by_onnxruntime(shipped()[name].read_bytes())
        before, after = inputs_of(name, windows), inputs_of(name, small)
        cost = _in_turns(partial(run, before), partial(run, after), len(windows))
        rows.append((f"{name}, zeros of the windows", "window", *cost, *difference(run(after), run(before))))
    idle = IDLE_LEVEL + NOISE * np.random.default_rng(6).standard_normal((IDLE_FRAMES, 9, 9))
    for name, gain in COUNTS.items():
        usual, least = idle.astype(name), (idle * gain).astype(name)
        cost = _in_turns(partial(_felt, usual), partial(_felt, least), IDLE_FRAMES)
        rows.append((f"front end, idle, {name} counts", "frame", *cost, "-", "-"))
    return Table(
        "Denormals: processor time against ordinary numbers",
        ("what is denormal", "of one", "us, ordinary", "us, denormal", "times", "change of a score", "labels changed"),
        rows,
        (
            f"Processor time, the median of {ROUNDS} pairs in turns; `times`: the median of their ratios. The",
            f"models run windows of simulated gestures with {DENORMAL:g} of the peak in the place of 0, the front",
            "end frames of an idle sensor.",
        ),
    )


def _felt(frames: Array) -> None:
    front = FrontEnd(*frames.shape[1:])
    for k, values in enumerate(frames):
        front.push(Frame(k / 15, values))


def _in_turns(one: Callable[[], object], other: Callable[[], object], count: int) -> tuple[float, float, float]:
    """(microseconds of one, of the other, ratio) for each of `count` things."""
    pairs = np.array([(_us(one), _us(other)) for _ in range(ROUNDS + 1)][1:]) / count
    return float(np.median(pairs[:, 0])), float(np.median(pairs[:, 1])), float(np.median(pairs[:, 1] / pairs[:, 0]))


def _us(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return 1e6 * (time.process_time() - start)
