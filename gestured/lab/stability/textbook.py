"""The same filter by the textbook: what each method costs and how far it is off, in one step a frame and in many."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.lab.stability.relaxation import exact, steps
from gestured.lab.table import Table

TAXELS = 81
SUBSTEPS = (1, 4, 16, 64, 256)

# The share of the way from state to input that one step of dt / tau = z goes.
INTEGRATORS: dict[str, Callable[[float], float]] = {
    "ours: -expm1(-z)": lambda z: -math.expm1(-z),
    "1 - exp(-z)": lambda z: 1.0 - math.exp(-z),
    "explicit Euler: z": lambda z: z,
    "implicit Euler: z / (1 + z)": lambda z: z / (1.0 + z),
    "bilinear: z / (1 + z / 2)": lambda z: z / (1.0 + z / 2.0),
}
EXACT = ("ours: -expm1(-z)", "1 - exp(-z)")  # more steps a frame change nothing
RANGES = {
    "frames as sensors send them (dt / tau from 1e-3 to 30)": (-3.0, 1.5),
    "any (dt / tau from 1e-9 to 1e9)": (-9.0, 9.0),
}


@dataclass(frozen=True, slots=True)
class Point:
    """One method with so many steps a frame."""

    method: str
    substeps: int
    error: float  # the largest, inputs being 0..1; infinite where it diverged
    seconds: float  # of processor time for a frame of `TAXELS` taxels
    negative: bool  # it went below 0, where the exact answer does not


def advance(share: Callable[[float], float], substeps: int, times: NDArray[Any], inputs: NDArray[Any]) -> NDArray[Any]:
    """(n + 1,) times, (n + 1, N) inputs -> (n, N) states, from 0, in the inputs' dtype."""
    state = np.zeros_like(inputs[0])
    out = np.zeros_like(inputs[1:])
    for k, dt in enumerate(np.diff(times)):
        part = share(float(dt) / substeps)
        for _ in range(substeps):
            state = state + (inputs[k + 1] - state) * part
        out[k] = state
    return out


def points(low: float, high: float, dtype: Any, quick: bool) -> list[Point]:
    """Every method and number of steps, on frames whose dt / tau are log-uniform from 10^low to 10^high."""
    count = 60 if quick else 300
    rng = np.random.default_rng(5)
    times = np.concatenate([[0.0], np.cumsum(10.0 ** rng.uniform(low, high, count))])
    inputs = np.repeat(rng.random((count + 1, 1)), TAXELS, axis=1).astype(dtype)
    right = exact(times, inputs[:, 0], 1.0, 0.0)[:, None]
    found = []
    for name, share in INTEGRATORS.items():
        for substeps in SUBSTEPS[: 1 if name in EXACT else 4 if quick else None]:
            with np.errstate(all="ignore"):
                best = math.inf
                for _ in range(3):
                    start = time.process_time()
                    out = advance(share, substeps, times, inputs)
                    best = min(best, time.process_time() - start)
                error = float(np.abs(out.astype(np.float64) - right).max())
            slack = 4 * float(np.finfo(dtype).eps)
            found.append(
                Point(name, substeps, error if error < 1e3 else math.inf, best / count, not bool((out >= -slack).all()))
            )
    return found


def small_steps(dtype: Any) -> dict[str, float]:
    """Of each method: error of 100 steps of 1e-9 tau, as a share of how far they lead."""
    times = steps(100, 3, -9, 1.0)
    inputs = np.random.default_rng(3).random((101, 1)).astype(dtype)
    right = exact(times, inputs[:, 0], 1.0, 0.0)
    return {
        name: float(np.abs(advance(share, 1, times, inputs)[:, 0] - right).max() / right.max())
        for name, share in INTEGRATORS.items()
    }


def textbook_table(title: str, found: list[Point], single: list[Point]) -> Table:
    """`found` in float64, `single` the same in float32."""
    small = {np.float64: small_steps(np.float64), np.float32: small_steps(np.float32)}
    return Table(
        f"Methods: {title}",
        ("method", "steps a frame", "error", "error in float32", "error at 1e-9", "below 0", "us a frame"),
        [
            (
                point.method,
                point.substeps,
                "diverges" if math.isinf(point.error) else point.error,
                "diverges" if math.isinf(other.error) else other.error,
                small[np.float64][point.method] if point.substeps == 1 else "",
                "yes" if point.negative else "no",
                1e6 * point.seconds,
            )
            for point, other in zip(found, single, strict=True)
        ],
        (
            f"Inputs of 0 to 1, held between frames; {TAXELS} taxels. `error`: the largest, absolute. `error at",
            "1e-9`: of 100 steps of dt / tau = 1e-9, as a share of how far they lead. `us a frame`: processor time.",
        ),
    )
