"""Segments that no sensor should give: at and beyond the ends of what a front end cuts."""

from collections.abc import Iterator

import numpy as np

from gestured.core.frames import Segment
from gestured.lab.stability.path import FINITE, NOISE, SIGNAL, Array, finger


def segment_cases(quick: bool) -> Iterator[Segment]:
    """Segments of any scale, offset, length and grid, constant or alternating, of one taxel or none."""
    rng = np.random.default_rng(2)
    times = np.arange(12) / 15 + 5.0
    base = np.array([finger(4, 0.7 * k, 9, 9, 1.0) for k in range(12)]) + NOISE * rng.standard_normal((12, 9, 9))

    def made(frames: Array, at: Array = times, noise: float = NOISE) -> Segment:
        return Segment(np.asarray(frames, np.float32), at[: len(frames)], 0, len(frames) - 1, noise)

    for power in range(-45, 36, 5):
        for noise in (10.0**power, 0.0, 1e-300, 1e300):
            yield made(base * 10.0**power, noise=noise)
    for offset in (1e4, 1e5, 1e6, 1e7):
        yield made(base + offset * SIGNAL)
    for value in FINITE:
        for noise in (NOISE, 0.0):
            yield made(np.full((12, 9, 9), value), noise=noise)
            yield made(np.full((1, 9, 9), value), noise=noise)
    for taxel in range(0, 81, 9 if quick else 1):
        for value in (SIGNAL, FINITE[0]):
            yield made(value * np.eye(81)[[taxel] * 12].reshape(12, 9, 9))
    signs = np.where(np.indices((12, 9, 9)).sum(axis=0) % 2, 1.0, -1.0)
    for value in (1.0, SIGNAL, 1e30, FINITE[0]):
        yield made(value * signs)
        yield made(value * np.maximum(signs, 0.0))
    for count in (1, 2, 3, 10, 100, 1000, *(() if quick else (10_000,))):
        for rate in (5, 15, 60, 1000):
            long = np.array([finger(4, 8 * k / count, 9, 9, 1.0) for k in range(count)])
            yield made(long, np.arange(count) / rate)
    for shape in ((2, 2), (2, 64), (64, 2), (3, 5), (27, 15), (64, 64)):
        moved = np.array([finger(shape[0] / 2, shape[1] * k / 12, *shape, 1.0) for k in range(12)])
        for frames in (moved, -moved, 0.0 * moved, 0.0 * moved + FINITE[0]):
            yield made(frames)
