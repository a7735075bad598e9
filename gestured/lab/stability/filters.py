"""The first-order filters of the core, compared with exact results of 50 digits.

Each follows dy/dt = (x - y) / tau for an input that is held between two frames, so that the exact answer is
y + (x - y) (1 - exp(-dt / tau)) from one frame to the next. Times may repeat, and lie a day apart.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal, localcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.activity import Activity
from gestured.core.contact import AFTER_S, RECOVERY_S, AfterEffect
from gestured.core.idle import BASELINE_TAU_S, NOISE_TAU_S, RECOVERY_TAU_S, REVIEW_S, UNSEEN_S, Idle
from gestured.core.settling import SIGMA_PER_DEVIATION
from gestured.lab.table import Table, Value

Array = NDArray[Any]
DECADES = (-9, -6, -3, -1, 0, 1, 3, 6, 9)  # of dt / tau
DAY_S = 86_400.0


@dataclass(frozen=True, slots=True)
class Filter:
    """A filter of the core: its constants, and how it is run."""

    name: str
    tau_s: float
    run: Callable[[Array, Array], Array]  # times (n,) s from 0 on, inputs (n,) 0 to 1 -> outputs (n,)
    start: float = 0.0  # its output at 0 s
    least_s: float = 0.0  # it does not step by less than this ...
    most_s: float = math.inf  # ... nor by more
    over_s: float = math.inf  # after this its output is 0, by decision
    driven: bool = True  # whether it follows an input, or decays whatever comes


def _baseline(times: Array, inputs: Array, *, recovering: bool = False) -> Array:
    made, out, since = Idle(9), np.zeros_like(inputs), 0.0
    for k, (t, x) in enumerate(zip(times.tolist(), inputs, strict=True)):
        made.follow(t, since, x - made.counts, recovering=recovering)
        out[k], since = made.counts[0], t
    return out


def _after_a_contact(times: Array, inputs: Array) -> Array:
    return _baseline(times, inputs, recovering=True)


def _noise(times: Array, inputs: Array) -> Array:
    made, out = Idle(9), np.zeros_like(inputs)
    made.sigma = np.full(9, 0.75)
    for k, (t, x) in enumerate(zip(times.tolist(), inputs, strict=True)):
        made.follow_noise(t, np.full(9, (0.5 + 0.5 * x) / SIGMA_PER_DEVIATION))  # never taken for an outlier
        out[k] = 2.0 * made.sigma[0] - 1.0
    return out


def _usual(times: Array, inputs: Array) -> Array:
    made, out, since = Activity(3, 3), np.zeros_like(inputs), 0.0
    made.unlearn()
    for k, (t, x) in enumerate(zip(times.tolist(), inputs.tolist(), strict=True)):
        made.follow(t, since, x)
        out[k], since = made.usual, t
    return out


def _after_effect(times: Array, inputs: Array) -> Array:
    made = AfterEffect(on=1.0)
    made.begin()
    made.touch(1.0)
    made.touch(1.0)
    made.fade(0.0)
    return np.array([made.level(t) for t in times.tolist()]) / made.level(0.0)


FILTERS = (
    Filter("baseline (core/idle)", BASELINE_TAU_S, _baseline),
    Filter("baseline after a contact (core/idle)", RECOVERY_TAU_S, _after_a_contact),
    Filter("noise (core/idle)", NOISE_TAU_S, _noise, 0.5, REVIEW_S, UNSEEN_S),
    Filter("idle activity (core/activity)", NOISE_TAU_S, _usual),
    Filter("after-effect of a contact (core/contact)", RECOVERY_S, _after_effect, 1.0, over_s=AFTER_S, driven=False),
)


def exact(of: Filter, times: Array, inputs: Array) -> Array:
    """(n,) what a filter gives at (n,) times in s for (n,) inputs, in 50 digits from the doubles given, as float64."""
    out = np.zeros(len(times))
    with localcontext(prec=50):
        y, seen = Decimal(of.start), Decimal(0)
        for k, (t, x) in enumerate(zip(map(Decimal, times.tolist()), map(Decimal, inputs.tolist()), strict=True)):
            seen = max(seen, t - Decimal(of.most_s)) if math.isfinite(of.most_s) else seen
            if t - seen >= of.least_s:
                y, seen = y + (x - y) * (1 - ((seen - t) / Decimal(of.tau_s)).exp()), t
            out[k] = float(y) if t <= of.over_s else 0.0
    return out


def steps(count: int, decade: float | None, tau_s: float) -> Array:
    """(count,) times in s.

    Their steps are of one decade of dt / tau, uneven by half; or (None) of every size: from 1e-9 to 1e9 tau in
    disorder, some of them 0 (a repeated time), some a day.
    """
    rng = np.random.default_rng([7, count])
    if decade is not None:
        return np.cumsum(tau_s * 10.0**decade * rng.uniform(0.5, 1.5, count))
    dt = tau_s * 10.0 ** rng.uniform(-9, 9, count)
    dt[rng.random(count) < 0.1] = 0.0
    dt[rng.random(count) < 0.1] = DAY_S
    return np.cumsum(dt[np.argsort(rng.random(count))])


def error(of: Filter, decade: float | None, count: int) -> tuple[float, bool]:
    """(largest error as a share of the largest exact output, whether it stayed within the inputs' range)."""
    times, inputs = steps(count, decade, of.tau_s), np.random.default_rng(8).random(count + 1)[1:] * of.driven
    right, found = exact(of, times, inputs), of.run(times, inputs)
    slack = 4 * float(np.finfo(np.float64).eps)
    inside = bool(np.isfinite(found).all() and found.min() >= -slack and found.max() <= 1.0 + slack)
    return float(np.abs(found - right).max() / max(np.abs(right).max(), 1e-300)), inside


def filters_table(quick: bool) -> Table:
    """Every filter over every decade; the last column but one mixes all sizes of steps."""
    rows: list[tuple[Value, ...]] = []
    for of in FILTERS:
        found = [error(of, decade, 32 if quick else 200) for decade in (*DECADES, None)]
        rows.append((of.name, *(value for value, _ in found), "yes" if all(inside for _, inside in found) else "NO"))
    return Table(
        "Filters: largest error against 50 digits, by dt / tau",
        ("filter", *(f"1e{d}" for d in DECADES), "mixed", "in range"),
        rows,
        (
            "Errors are shares of the largest exact output. `mixed`: steps of 1e-9 to 1e9 tau in disorder,",
            "repeated times and gaps of a day. `in range`: finite, never below nor above what came in. The noise",
            f"is looked at every {REVIEW_S:g} s: smaller steps add up. The after-effect ends after {AFTER_S:g} s.",
        ),
    )
