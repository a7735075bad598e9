"""The movement of fingers: speed profiles and paths, sampled on a fine time grid.

Sources: minimum jerk (Flash & Hogan 1985), lognormal speed of rapid strokes (Plamondon 1995, sigma-lognormal),
overlapping submovements that add up (Flash & Henis 1991), the two-thirds power law on curved paths (Lacquaniti,
Terzuolo & Viviani 1983). An ellipse whose parameter changes at a constant rate obeys the two-thirds law exactly, so
circles need no speed profile of their own.

Lengths are millimetres, x to the right, y upward, times seconds, angles radians (counter-clockwise positive).
"""

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
N = TypeVar("N", float, Array)
PATH_STEP_S = 0.004  # fine time grid: 250 Hz, four steps within the fastest rise of a tap


def grid(duration_s: float) -> Array:
    """Times (n,) from 0 to the duration, both included, about PATH_STEP_S apart; n >= 5."""
    return np.linspace(0.0, duration_s, max(5, math.ceil(duration_s / PATH_STEP_S) + 1))


def minimum_jerk(tau: Array) -> Array:
    """Progress 0..1 of a smooth reach at relative times tau (clipped to 0..1)."""
    u = np.clip(tau, 0.0, 1.0)
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


def normal_cdf(z: Array) -> Array:
    """The normal distribution function, as a tanh whose error is below 3e-4 (here a hundredth of a millimetre)."""
    return 0.5 * (1.0 + np.tanh(0.7978845608 * (z + 0.044715 * z * z * z)))


def lognormal(tau: Array, sigma: float, mirrored: bool = False) -> Array:
    """Progress 0..1 with a lognormal speed, which peaks early and has a long tail; with `mirrored` it peaks late.

    With `sigma` 0.2 the speed is almost symmetric, with 0.7 very skewed. The distribution is cut at its 99.5 % point.
    """
    u = np.clip(tau, 0.0, 1.0)
    if mirrored:
        return np.asarray(1.0 - lognormal(1.0 - u, sigma))
    z = np.log(np.maximum(u, 1e-9)) / sigma + 2.576
    return np.where(u <= 0.0, 0.0, np.minimum(normal_cdf(z) / 0.995, 1.0))


def stroke_progress(tau: Array, rng: np.random.Generator, moving_ends: float = 0.0) -> Array:
    """Progress 0..1 of one stroke at relative times `tau`, with a random human speed profile.

    `moving_ends` (0..1) is how fast the finger still is when it lands and leaves: it touches only the middle part of a
    longer movement.
    """
    first = 0.32 * moving_ends * rng.uniform(0.2, 1.0)
    last = 1.0 - 0.32 * moving_ends * rng.uniform(0.2, 1.0)
    style, sigma = rng.random(), rng.uniform(0.25, 0.65)
    v = np.clip(tau, 0.0, 1.0)
    if rng.random() < 0.15:
        # The finger sticks to the cloth and slips. Progress stays monotone, since the amplitude is below 1.
        waves, depth = rng.uniform(2.0, 6.0) * 2.0 * math.pi, rng.uniform(0.2, 0.85)
        v = v - depth * np.sin(waves * v) * (1.0 - v) / waves
    u = first + (last - first) * v
    ends = np.array([first, last])

    def profile(v: Array) -> Array:
        if style < 0.45:
            return minimum_jerk(v)
        return lognormal(v, sigma, mirrored=style > 0.85)

    a, b = profile(ends)
    return np.asarray((profile(u) - a) / (b - a))


def wander(t: Array, rng: np.random.Generator, low_hz: float, high_hz: float, waves: int = 4) -> Array:
    """Smooth random motion (n,) with a standard deviation of 1: a sum of sines between two frequencies."""
    f = rng.uniform(low_hz, high_hz, waves)
    phase = rng.uniform(0.0, 2.0 * math.pi, waves)
    amplitude = rng.uniform(0.3, 1.0, waves)
    amplitude *= math.sqrt(2.0 / float(np.sum(amplitude**2)))
    return np.sin(2.0 * math.pi * np.multiply.outer(t, f) + phase) @ amplitude


def arc(s: Array, length: float, heading: float, bend: float) -> tuple[Array, Array]:
    """x, y (n,) of a stroke from the origin at progress s along a circular arc.

    The chord points to `heading`; the direction turns by `bend` radians in all (0 is a straight line).
    """
    if abs(bend) < 1e-3:
        return s * length * math.cos(heading), s * length * math.sin(heading)
    radius = length / bend
    start = heading - 0.5 * bend
    angle = start + s * bend
    return radius * (np.sin(angle) - math.sin(start)), -radius * (np.cos(angle) - math.cos(start))


def ellipse(phase: Array, radius: Array, flatness: float, tilt: float) -> tuple[Array, Array]:
    """x, y (n,) around the origin, with the half axes radius * flatness**0.5 and radius / flatness**0.5, turned."""
    u, v = radius * math.sqrt(flatness) * np.cos(phase), radius / math.sqrt(flatness) * np.sin(phase)
    return turned(u, v, tilt)


def turned(x: N, y: N, angle: float) -> tuple[N, N]:
    """Points turned about the origin by `angle` radians."""
    c, s = math.cos(angle), math.sin(angle)
    return x * c - y * s, x * s + y * c


def turning(tau: Array, rng: np.random.Generator) -> Array:
    """Progress 0..1 around a closed curve: nearly even, with a random amount of easing in and out."""
    ease = rng.uniform(0.0, 0.25)
    even, smooth = np.clip(tau, 0.0, 1.0), minimum_jerk(tau)
    share = rng.uniform(0.1, 0.7)
    bumps = ease * 0.12 * np.sin(2.0 * math.pi * (even * rng.uniform(1.0, 3.0) + rng.random())) * even * (1.0 - even)
    return (1.0 - share) * even + share * smooth + bumps


def submovements(
    t: Array, points: Sequence[tuple[float, float]], starts: Sequence[float], durations: Sequence[float]
) -> tuple[Array, Array]:
    """x, y (n,) through via points: the sum of minimum-jerk movements from point to point.

    Movements that overlap in time round the corner between them, as hands do.
    """
    x = np.full_like(t, points[0][0])
    y = np.full_like(t, points[0][1])
    for (x0, y0), (x1, y1), start, duration in zip(points[:-1], points[1:], starts, durations, strict=True):
        s = minimum_jerk((t - start) / duration)
        x += (x1 - x0) * s
        y += (y1 - y0) * s
    return x, y


def polyline(
    points: Sequence[tuple[float, float]], leg_s: Sequence[float], overlap: float, pause_s: float
) -> tuple[Array, Array, Array]:
    """t, x, y (n,) of a stroke through via points.

    `leg_s` has each leg's duration. The next leg begins after `pause_s`, or, if this is 0, earlier than the end of the
    last one: by the share `overlap` of the shorter of both.
    """
    starts = [0.0]
    for before, after in zip(leg_s[:-1], leg_s[1:], strict=True):
        gap = pause_s if pause_s > 0.0 else -overlap * min(before, after)
        starts.append(starts[-1] + before + gap)
    t = grid(starts[-1] + leg_s[-1])
    x, y = submovements(t, points, starts, leg_s)
    return t, x, y
