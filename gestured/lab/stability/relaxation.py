"""The first-order filters as they stand in the code, driven from outside and held against 50 digits.

Each follows dy/dt = (x - y) / tau for an input that is held between two frames; its exact answer is
y + (x - y) (1 - exp(-dt / tau)). A run is (times, inputs) -> outputs; times may repeat, and lie a day apart.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from gestured.core.activity import Activity
from gestured.core.baseline import BASELINE_TAU_S, RECOVERY_TAU_S, Baseline
from gestured.core.contact import AFTER_S, RECOVERY_S, AfterEffect
from gestured.core.noise import NOISE_TAU_S, REVIEW_S, SIGMA_PER_DEVIATION, UNSEEN_S, Noise
from gestured.lab.stability.table import Table, Value
from gestured.simulator.textile import REMANENCE_S, relax

Array = NDArray[Any]
FilterRun = Callable[
    [Array, Array], Array
]  # times (n,) s, inputs (n,) 0..1 -> outputs (n,), in the inputs' dtype or better

DECADES = (-9, -6, -3, -1, 0, 1, 3, 6, 9)  # of dt / tau
DAY_S = 86_400.0


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
        made, out, since = Baseline(9), np.zeros_like(inputs), 0.0
        made.counts = made.counts.astype(inputs.dtype)
        for k, (t, x) in enumerate(zip(times.tolist(), inputs, strict=True)):
            made.follow(t, since, x - made.counts, recovering=recovering)
            out[k], since = made.counts[0], t
        return out

    return run


def _noise(times: Array, inputs: Array) -> Array:
    made, out = Noise(9), np.zeros_like(inputs)
    made.sigma = np.full(9, 0.75, inputs.dtype)
    for k, (t, x) in enumerate(zip(times.tolist(), inputs, strict=True)):
        above = np.full(9, (0.5 + 0.5 * x) / SIGMA_PER_DEVIATION, inputs.dtype)  # never taken for an outlier
        made.follow(t, above)
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
    made.end(0.0)
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
    Filter("baseline (core/baseline)", BASELINE_TAU_S, _baseline(False), 0.0),
    Filter("baseline after a contact (core/baseline)", RECOVERY_TAU_S, _baseline(True), 0.0),
    Filter("noise (core/noise)", NOISE_TAU_S, _noise, 0.5, REVIEW_S, UNSEEN_S),
    Filter("idle activity (core/activity)", NOISE_TAU_S, _usual, 0.0, dtypes=(np.float64,)),
    Filter(
        "after-effect of a contact (core/contact)",
        RECOVERY_S,
        _after_effect,
        1.0,
        over_s=AFTER_S,
        dtypes=(np.float64,),
    ),
    Filter("Prony branch (simulator/textile)", 1.0, _branch, 0.0, even=True),
    Filter("remanence (simulator/textile)", REMANENCE_S, _remanence, 1.0, even=True),
)
DECAYS = ("after-effect of a contact (core/contact)", "remanence (simulator/textile)")  # take no input


def exact(
    times: Array, inputs: Array, tau_s: float, start: float, least_s: float = 0.0, most_s: float = math.inf
) -> Array:
    """The filter's output after each of times[1:], computed with 50 digits from the doubles given, as float64.

    With `least_s` it waits until so much time has passed, with `most_s` it forgets what passed before that.
    """
    out = np.zeros(len(times) - 1)
    with mpmath.workdps(50):
        y, seen = mpmath.mpf(start), mpmath.mpf(float(times[0]))
        for k in range(1, len(times)):
            t, x = mpmath.mpf(float(times[k])), mpmath.mpf(float(inputs[k]))
            seen = max(seen, t - most_s) if math.isfinite(most_s) else seen
            if t - seen >= least_s:
                y += (x - y) * -mpmath.expm1(-(t - seen) / mpmath.mpf(tau_s))
                seen = t
            out[k - 1] = float(y)
    return out


def steps(count: int, seed: int, decade: float | None, tau_s: float, *, even: bool = False) -> Array:
    """(count + 1,) times from 0 s.

    At one decade of dt / tau, uneven by half; or (None) of every size: from 1e-9 to 1e9 tau in disorder, some of them 0
    (a repeated time), some a day.
    """
    rng = np.random.default_rng([seed, count])
    if decade is None:
        dt = tau_s * 10.0 ** rng.uniform(-9, 9, count)
        dt[rng.random(count) < 0.1] = 0.0
        dt[rng.random(count) < 0.1] = DAY_S
        dt = dt[np.argsort(rng.random(count))]
    else:
        dt = np.full(count, tau_s * 10.0**decade) * (1.0 if even else rng.uniform(0.5, 1.5, count))
    return np.concatenate([[0.0], np.cumsum(dt)])


def error(filter_: Filter, decade: float | None, dtype: Any, count: int) -> tuple[float, bool]:
    """(largest error as a share of the largest exact output, whether it stayed within the inputs' range)."""
    times = steps(count, 7, decade, filter_.tau_s, even=filter_.even)
    inputs = np.random.default_rng(8).random(count + 1).astype(dtype)
    if filter_.name in DECAYS:
        inputs[:] = 0.0
    right = exact(times, inputs, filter_.tau_s, filter_.start, filter_.least_s, filter_.most_s)
    right[times[1:] > filter_.over_s] = 0.0
    found = filter_.run(times, inputs) if filter_.even else filter_.run(times[1:], inputs[1:])
    slack = 4 * float(np.finfo(dtype).eps)
    inside = bool(np.all(np.isfinite(found)) and found.min() >= -slack and found.max() <= 1.0 + slack)
    return float(np.abs(found.astype(np.float64) - right).max() / max(np.abs(right).max(), 1e-300)), inside


def _seconds(filter_: Filter, count: int) -> float:
    """Seconds a step, the best of five runs, the code that holds the filter alone."""
    times = steps(count, 7, -1, filter_.tau_s, even=filter_.even)
    inputs = np.zeros(count + 1)
    best = math.inf
    for _ in range(5):
        start = time.perf_counter()
        filter_.run(times, inputs)
        best = min(best, time.perf_counter() - start)
    return best / count


def filters_table(quick: bool) -> Table:
    """Every filter over every decade, in float64 and float32; the last but two columns mix all sizes of steps."""
    count = 32 if quick else 200
    rows: list[tuple[Value, ...]] = []
    for filter_ in FILTERS:
        for dtype in filter_.dtypes:
            cells: list[Value] = []
            inside = True
            for decade in (*DECADES, None):
                if decade is None and filter_.even:
                    cells.append("-")
                    continue
                found, within = error(filter_, decade, dtype, count)
                cells.append(found)
                inside &= within
            rows.append(
                (filter_.name, np.dtype(dtype).name, *cells, "yes" if inside else "NO", 1e6 * _seconds(filter_, count))
            )
    return Table(
        "Filters: largest error against 50 digits, by dt / tau",
        ("filter", "state", *(f"1e{d}" for d in DECADES), "mixed", "in range", "us a step"),
        rows,
        (
            "Errors are shares of the largest exact output. `mixed`: steps of 1e-9 to 1e9 tau in disorder,",
            "repeated times and gaps of a day. `in range`: finite, never below nor above what came in. `us a",
            "step`: of the code that holds the filter. The noise is looked at every 0.5 s:",
            f"smaller steps add up. The after-effect ends after {AFTER_S:g} s; remanence below 1e-5 is taken for",
            "nothing, which is its error at 1 tau.",
        ),
    )
