"""The code's first-order filters, held against 50 digits.

The exact answer of each is y + (x - y) (1 - exp(-dt / tau)) from one frame to the next.
"""

import math
from typing import Any

import mpmath
import numpy as np

from gestured.core.contact import AFTER_S
from gestured.lab.stability.filters import DECAYS, FILTERS, Array, Filter
from gestured.lab.table import Table, Value

DECADES = (-9, -6, -3, -1, 0, 1, 3, 6, 9)  # of dt / tau
DAY_S = 86_400.0


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
            rows.append((filter_.name, np.dtype(dtype).name, *cells, "yes" if inside else "NO"))
    return Table(
        "Filters: largest error against 50 digits, by dt / tau",
        ("filter", "state", *(f"1e{d}" for d in DECADES), "mixed", "in range"),
        rows,
        (
            "Errors are shares of the largest exact output. `mixed`: steps of 1e-9 to 1e9 tau in disorder,",
            "repeated times and gaps of a day. `in range`: finite, never below nor above what came in. The noise",
            f"is looked at every 0.5 s: smaller steps add up. The after-effect ends after {AFTER_S:g} s; remanence",
            "below 1e-5 is taken for nothing, which is its error at 1 tau.",
        ),
    )
