"""Windows made by hand, and what a pair of eyes would call them."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

SIDE = 9
FRAMES = NDArray[np.float32]  # (T, 9, 9), peak 1, a quiet frame at both ends


def window(*paths: Sequence[tuple[float, float]], width: float = 0.8) -> FRAMES:
    """One round finger for each path of (column, row) points, all as long; column 0 is left, row 0 the top."""
    rows, columns = np.mgrid[:SIDE, :SIDE]
    frames = np.zeros((len(paths[0]) + 2, SIDE, SIDE), np.float32)
    for path in paths:
        for t, (x, y) in enumerate(path, 1):
            frames[t] += np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2 * width**2)).astype(np.float32)
    return frames / frames.max()


def line(start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> list[tuple[float, float]]:
    """Points at equal distances."""
    return [(x, y) for x, y in np.linspace(start, end, steps).tolist()]


def ring(sense: int, steps: int = 16, radius: float = 2.6, begin: float = 1.1) -> list[tuple[float, float]]:
    """A whole circle about the middle; `sense` +1 counter-clockwise as seen, -1 clockwise."""
    phases = begin + sense * np.linspace(0, 2 * math.pi, steps)
    return [(4 + radius * math.cos(p), 4 - radius * math.sin(p)) for p in phases]


def gestures(shift: float = 0.0) -> dict[str, FRAMES]:
    """The ten gestures, and the two that two fingers draw sideways; `shift` moves and shortens them a little."""
    low, high, mid = 0.8 + shift, 7.2 - shift / 2, 4.0 + shift
    tap, still = [(mid, 4.0)] * 2, line((mid, 4), (mid, 4), 2)
    double = window(tap)
    return {
        "one_tap": double,
        "double_tap": np.concatenate([double[:-1], np.zeros((2, SIDE, SIDE), np.float32), window(still)]),
        "swipe_down": window(line((mid, low), (mid, high))),
        "swipe_up": window(line((mid, high), (mid, low))),
        "swipe_right": window(line((low, mid), (high, mid))),
        "swipe_left": window(line((high, mid), (low, mid))),
        "circle_clockwise": window(ring(-1, begin=1.1 + shift)),
        "circle_counter_clockwise": window(ring(1, begin=1.1 + shift)),
        "swipe_up_two_fingers": window(line((2, high), (2, low)), line((6, high), (6, low))),
        "swipe_down_two_fingers": window(line((2, low), (2, high)), line((6, low), (6, high))),
        "two_finger_swipe_right": window(line((low, 2), (high, 2)), line((low, 6), (high, 6))),
        "two_finger_swipe_left": window(line((high, 2), (low, 2)), line((high, 6), (low, 6))),
    }


def direction(frames: NDArray[np.floating]) -> str:
    """What the way of the centroid shows: up, down, left, right, clockwise, counter_clockwise or none."""
    pressed = frames[frames.max(axis=(1, 2)) > 0.3].astype(np.float64)
    pressed = np.maximum(pressed - 0.15, 0)
    total = pressed.sum(axis=(1, 2))
    rows, columns = pressed.shape[1:]
    x = pressed.sum(axis=1) @ np.arange(columns) / total
    y = -(pressed.sum(axis=2) @ np.arange(rows)) / total  # upward
    phase = np.unwrap(np.arctan2(y - (y.max() + y.min()) / 2, x - (x.max() + x.min()) / 2))
    dx, dy = x[-1] - x[0], y[-1] - y[0]
    if math.hypot(dx, dy) < 0.8 * min(np.ptp(x), np.ptp(y)) and abs(phase[-1] - phase[0]) > math.pi:
        return "counter_clockwise" if phase[-1] > phase[0] else "clockwise"
    if math.hypot(dx, dy) < 1.5:
        return "none"
    if abs(dx) > abs(dy):
        return "right" if dx > 0 else "left"
    return "up" if dy > 0 else "down"


def direction_of(label: str) -> str:
    """The same, as a label's words say it."""
    name = label.removesuffix("_two_fingers").removeprefix("two_finger_")
    for start in ("swipe_", "circle_"):
        if name.startswith(start):
            return name.removeprefix(start)
    return "none"
