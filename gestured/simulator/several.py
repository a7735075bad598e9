"""What several fingers do that is none of the ten gestures."""

import math

import numpy as np

from gestured.simulator.gestures import DOWN, LEFT, RIGHT, UP, swipe
from gestured.simulator.kinematics import grid, progress
from gestured.simulator.people import Contact
from gestured.simulator.strokes import Scene, touch_down


def knuckles(scene: Scene) -> list[Contact]:
    """A knock with three or four knuckles at once, once or twice."""
    rng = scene.rng
    count, gap = int(rng.integers(3, 5)), rng.uniform(14.0, 22.0)
    angle = rng.normal(0.0, 0.5)
    x, y = scene.spot(gap, 4.0)
    made: list[Contact] = []
    start = 0.0
    for _ in range(int(rng.integers(1, 3))):
        duration = rng.uniform(0.05, 0.2)
        for k in range(count):
            along = (k - (count - 1) / 2) * min(gap, 0.8 * scene.small / (count - 1))
            made.append(
                touch_down(
                    scene,
                    x + along * math.cos(angle),
                    y + along * math.sin(angle),
                    duration,
                    start + rng.uniform(0.0, 0.02),
                    force=rng.uniform(0.5, 1.5),
                )
            )
        start += duration + rng.uniform(0.15, 0.3)
    return made


def drumming(scene: Scene) -> list[Contact]:
    """Several fingers tap one after the other at places apart, four to ten taps."""
    rng = scene.rng
    fingers = int(rng.integers(2, 5))
    gap = min(scene.spacing(), 0.8 * scene.small / (fingers - 1))
    x, y = scene.spot(gap * (fingers - 1) / 2, 6.0)
    angle = rng.normal(0.0, 0.35)
    made, start = [], 0.0
    order = int(rng.choice([-1, 1]))
    for k in range(int(rng.integers(4, 11))):
        along = ((order * k) % fingers - (fingers - 1) / 2) * gap
        made.append(
            touch_down(
                scene,
                x + along * math.cos(angle),
                y + along * math.sin(angle) + rng.normal(0.0, 2.0),
                scene.tap_s(),
                start,
                force=rng.uniform(0.6, 1.2),
            )
        )
        start += rng.uniform(0.06, 0.2)
    return made


def two_finger_tap(scene: Scene) -> list[Contact]:
    """Two or three fingers at once for 50 to 400 ms, sometimes longer, once or twice."""
    rng = scene.rng
    count = int(rng.choice([2, 3], p=[0.75, 0.25]))
    gap = min(scene.spacing(), 0.8 * scene.small / (count - 1))
    angle = rng.uniform(-0.9, 0.9)
    x, y = scene.spot(gap * (count - 1) / 2, gap / 3)
    made: list[Contact] = []
    start, held = 0.0, rng.random() < 0.2
    for _ in range(1 if held else int(rng.choice([1, 2], p=[0.7, 0.3]))):
        duration = rng.uniform(0.5, 1.6) if held else scene.tap_s() * rng.uniform(1.0, 1.3)
        for k in range(count):
            along = (k - (count - 1) / 2) * gap
            made.append(
                touch_down(
                    scene,
                    x + along * math.cos(angle),
                    y + along * math.sin(angle),
                    duration,
                    start + rng.uniform(0.0, min(0.05, 0.3 * duration)),
                    rng.uniform(0.5, 1.1),
                )
            )
        start += duration + scene.gap_s()
    return made


def _two(scene: Scene, distance: tuple[float, float], turn: float) -> list[Contact]:
    """Two fingers about their middle: from one distance (mm) to another while the line between them turns."""
    rng = scene.rng
    before, after = scene.rests()
    move = float(np.clip(0.5 / scene.rate * rng.lognormal(0.0, 0.2), 0.18, 1.6))
    t = grid(before + move + after)
    s = progress((t - before) / move, rng)
    angle = rng.uniform(0.0, math.pi) + turn * s
    half = 0.5 * (distance[0] + (distance[1] - distance[0]) * s)
    lean = rng.uniform(0.2, 0.8)  # one finger may do most of the way
    dx, dy = half * np.cos(angle), half * np.sin(angle)
    shift = rng.normal(0.0, 0.04, 2) * scene.small
    xs = np.concatenate([2 * lean * dx, -2 * (1 - lean) * dx]) + shift[0] * np.concatenate([s, s])
    ys = np.concatenate([2 * lean * dy, -2 * (1 - lean) * dy]) + shift[1] * np.concatenate([s, s])
    xs, ys = scene.settle(xs, ys)
    n = t.size
    return [
        scene.finger(
            t,
            xs[k * n : (k + 1) * n],
            ys[k * n : (k + 1) * n],
            size=1.0 + 0.2 * k,
            force=rng.uniform(0.6, 1.1),
            start=k * rng.uniform(0.0, 0.05),
        )
        for k in range(2)
    ]


def pinch(scene: Scene) -> list[Contact]:
    """Two fingers move together."""
    far = scene.small * scene.rng.uniform(0.45, 0.85)
    return _two(scene, (far, far * scene.rng.uniform(0.15, 0.45)), scene.rng.normal(0.0, 0.25))


def spread(scene: Scene) -> list[Contact]:
    """Two fingers move apart."""
    far = scene.small * scene.rng.uniform(0.45, 0.85)
    return _two(scene, (far * scene.rng.uniform(0.15, 0.45), far), scene.rng.normal(0.0, 0.25))


def rotation(scene: Scene) -> list[Contact]:
    """Two fingers turn about their middle by 50 to 140 degrees."""
    far = scene.small * scene.rng.uniform(0.35, 0.7)
    turn = math.radians(scene.rng.uniform(50.0, 140.0)) * scene.rng.choice([-1.0, 1.0])
    return _two(scene, (far, far * scene.rng.uniform(0.8, 1.2)), turn)


def three_finger_swipe(scene: Scene) -> list[Contact]:
    """Three fingers side by side in any of the four directions."""
    return swipe(float(scene.rng.choice([RIGHT, UP, LEFT, DOWN])), 3)(scene)
