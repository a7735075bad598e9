"""The first-order filters as they stand in the code, driven from outside.

Each follows dy/dt = (x - y) / tau for an input that is held between two frames. A run is (times, inputs) -> outputs;
times may repeat, and lie a day apart.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.activity import Activity
from gestured.core.contact import AFTER_S, RECOVERY_S, AfterEffect
from gestured.core.idle import BASELINE_TAU_S, NOISE_TAU_S, RECOVERY_TAU_S, REVIEW_S, UNSEEN_S, Idle
from gestured.core.settling import SIGMA_PER_DEVIATION
from gestured.simulator.textile import REMANENCE_S, relax

Array = NDArray[Any]
FilterRun = Callable[
    [Array, Array], Array
]  # times (n,) s, inputs (n,) 0..1 -> outputs (n,), in the inputs' dtype or better


@dataclass(frozen=True, slots=True)
class Filter:
    """A filter of the code: where it stands, and how it is run."""

    name: str
    tau_s: float
    run: FilterRun
    start: float  # its output at times[0]
    least_s: float = 0.0  # it does not step by less than this ...
    most_s: float = math.inf  # ... nor by more
    over_s: float = math.inf  # after this it is nothing, by decision
    even: bool = False  # takes frames at one distance only
    dtypes: tuple[Any, ...] = (np.float64, np.float32)  # that its state can have


def _baseline(recovering: bool) -> FilterRun:
    def run(times: Array, inputs: Array) -> Array:
        made, out, since = Idle(9), np.zeros_like(inputs), 0.0
        made.counts = made.counts.astype(inputs.dtype)
        for k, (t, x) in enumerate(zip(times.tolist(), inputs, strict=True)):
            made.follow(t, since, x - made.counts, recovering=recovering)
            out[k], since = made.counts[0], t
        return out

    return run


def _noise(times: Array, inputs: Array) -> Array:
    made, out = Idle(9), np.zeros_like(inputs)
    made.sigma = np.full(9, 0.75, inputs.dtype)
    for k, (t, x) in enumerate(zip(times.tolist(), inputs, strict=True)):
        above = np.full(9, (0.5 + 0.5 * x) / SIGMA_PER_DEVIATION, inputs.dtype)  # never taken for an outlier
        made.follow_noise(t, above)
        out[k] = 2.0 * made.sigma[0] - 1.0
    return out


def _usual(times: Array, inputs: Array) -> Array:
    made, out, since = Activity(3, 3), np.zeros(len(inputs)), 0.0
    made.unlearn()
    for k, (t, x) in enumerate(zip(times.tolist(), inputs.tolist(), strict=True)):
        made.follow(t, since, x)
        out[k], since = made.usual, t
    return out


def _after_effect(times: Array, inputs: Array) -> Array:
    """Decays from 1 whatever comes: `inputs` is 0 for it."""
    made = AfterEffect(on=1.0)
    made.begin()
    made.touch(1.0)
    made.touch(1.0)
    made.fade(0.0)
    scale = made.level(0.0)
    return np.array([made.level(float(t)) / scale for t in times])


def _branch(times: Array, inputs: Array) -> Array:
    """One Prony branch of the simulated textile with a tau of 1 s."""
    dt = float(times[1] - times[0])
    return relax(inputs[1:, None, None], dt, (1.0,), (1.0,), 0.0)[:, 0, 0]


def _remanence(times: Array, inputs: Array) -> Array:
    """What a touch leaves behind: half the play operator's state, which begins at 0.5."""
    dt = float(times[1] - times[0])
    field = np.zeros((len(times), 1, 1), inputs.dtype)
    field[0] = 1.0
    return 4.0 * relax(field, dt, (), (), 0.5)[1:, 0, 0]


FILTERS = (
    Filter("baseline (core/idle)", BASELINE_TAU_S, _baseline(False), 0.0),
    Filter("baseline after a contact (core/idle)", RECOVERY_TAU_S, _baseline(True), 0.0),
    Filter("noise (core/idle)", NOISE_TAU_S, _noise, 0.5, REVIEW_S, UNSEEN_S),
    Filter("idle activity (core/activity)", NOISE_TAU_S, _usual, 0.0, dtypes=(np.float64,)),
    Filter(
        "after-effect of a contact (core/contact)", RECOVERY_S, _after_effect, 1.0, over_s=AFTER_S, dtypes=(np.float64,)
    ),
    Filter("Prony branch (simulator/textile)", 1.0, _branch, 0.0, even=True),
    Filter("remanence (simulator/textile)", REMANENCE_S, _remanence, 1.0, even=True),
)
DECAYS = ("after-effect of a contact (core/contact)", "remanence (simulator/textile)")  # take no input
