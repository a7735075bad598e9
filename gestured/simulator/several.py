"""Taps and movements of several fingers that are none of the ten gestures."""

import math

import numpy as np

from gestured.simulator.gestures import DOWN, LEFT, RIGHT, UP, swipe
from gestured.simulator.kinematics import grid, stroke_progress
from gestured.simulator.occasion import Maker, Occasion, named
from gestured.simulator.people import Press
from gestured.simulator.strokes import touch_down


def _row(middle: tuple[float, float], angle: float, gap: float, count: int) -> list[tuple[float, float]]:
    """Places (mm) of so many fingers in a row about their middle, `gap` millimetres apart."""
    x, y = middle
    along = [(k - (count - 1) / 2) * gap for k in range(count)]
    return [(x + a * math.cos(angle), y + a * math.sin(angle)) for a in along]


def knuckles(occasion: Occasion) -> list[Press]:
    """A knock with three or four knuckles at once, once or twice."""
    rng = occasion.rng
    count, gap = int(rng.integers(3, 5)), rng.uniform(14.0, 22.0)
    angle = rng.normal(0.0, 0.5)
    places = _row(occasion.spot(gap, 4.0), angle, min(gap, 0.8 * occasion.small / (count - 1)), count)
    made: list[Press] = []
    start = 0.0
    for _ in range(int(rng.integers(1, 3))):
        duration = rng.uniform(0.05, 0.2)
        made += [
            touch_down(occasion, x, y, duration, start + rng.uniform(0.0, 0.02), rng.uniform(0.5, 1.5))
            for x, y in places
        ]
        start += duration + rng.uniform(0.15, 0.3)
    return made


def drumming(occasion: Occasion) -> list[Press]:
    """Several fingers tap one after the other, each at its place: four to ten taps."""
    rng = occasion.rng
    fingers = int(rng.integers(2, 5))
    gap = min(occasion.spacing(), 0.8 * occasion.small / (fingers - 1))
    middle = occasion.spot(gap * (fingers - 1) / 2, 6.0)
    places = _row(middle, rng.normal(0.0, 0.35), gap, fingers)
    made, start = [], 0.0
    order = int(rng.choice([-1, 1]))
    for k in range(int(rng.integers(4, 11))):
        x, y = places[(order * k) % fingers]
        y += rng.normal(0.0, 2.0)
        made.append(touch_down(occasion, x, y, occasion.tap_s(), start, rng.uniform(0.6, 1.2)))
        start += rng.uniform(0.06, 0.2)
    return made


def two_finger_tap(occasion: Occasion) -> list[Press]:
    """Two or three fingers at once: once or twice for 40 to 590 ms, or once for 0.5 to 1.6 s."""
    rng = occasion.rng
    count = int(rng.choice([2, 3], p=[0.75, 0.25]))
    gap = min(occasion.spacing(), 0.8 * occasion.small / (count - 1))
    angle = rng.uniform(-0.9, 0.9)
    places = _row(occasion.spot(gap * (count - 1) / 2, gap / 3), angle, gap, count)
    made: list[Press] = []
    start, held = 0.0, rng.random() < 0.2
    for _ in range(1 if held else int(rng.choice([1, 2], p=[0.7, 0.3]))):
        duration = rng.uniform(0.5, 1.6) if held else occasion.tap_s() * rng.uniform(1.0, 1.3)
        late_s = min(0.05, 0.3 * duration)  # by which one finger may land after another
        made += [
            touch_down(occasion, x, y, duration, start + rng.uniform(0.0, late_s), rng.uniform(0.5, 1.1))
            for x, y in places
        ]
        start += duration + occasion.gap_s()
    return made


def _two(occasion: Occasion, distance: tuple[float, float], turn: float) -> list[Press]:
    """Two fingers move from one distance (mm) to another, while the line between them turns by `turn` radians."""
    rng = occasion.rng
    before, after = occasion.rests()
    move = float(np.clip(0.5 / occasion.rate * rng.lognormal(0.0, 0.2), 0.18, 1.6))
    t = grid(before + move + after)
    s = stroke_progress((t - before) / move, rng)
    angle = rng.uniform(0.0, math.pi) + turn * s
    half = 0.5 * (distance[0] + (distance[1] - distance[0]) * s)
    lean = rng.uniform(0.2, 0.8)  # one finger may move further than the other
    dx, dy = half * np.cos(angle), half * np.sin(angle)
    shift = rng.normal(0.0, 0.04, 2) * occasion.small
    xs = np.concatenate([2 * lean * dx, -2 * (1 - lean) * dx]) + shift[0] * np.concatenate([s, s])
    ys = np.concatenate([2 * lean * dy, -2 * (1 - lean) * dy]) + shift[1] * np.concatenate([s, s])
    ways = zip(*(np.split(moved, 2) for moved in occasion.settle(xs, ys)), strict=True)
    return [
        occasion.finger(t, x, y, size=1.0 + 0.2 * k, force=rng.uniform(0.6, 1.1), start=k * rng.uniform(0.0, 0.05))
        for k, (x, y) in enumerate(ways)
    ]


def pinch(occasion: Occasion) -> list[Press]:
    """Two fingers move towards each other."""
    far = occasion.small * occasion.rng.uniform(0.45, 0.85)
    return _two(occasion, (far, far * occasion.rng.uniform(0.15, 0.45)), occasion.rng.normal(0.0, 0.25))


def spread(occasion: Occasion) -> list[Press]:
    """Two fingers move apart."""
    far = occasion.small * occasion.rng.uniform(0.45, 0.85)
    return _two(occasion, (far * occasion.rng.uniform(0.15, 0.45), far), occasion.rng.normal(0.0, 0.25))


def rotation(occasion: Occasion) -> list[Press]:
    """Two fingers turn about their middle by 50 to 140 degrees."""
    far = occasion.small * occasion.rng.uniform(0.35, 0.7)
    turn = math.radians(occasion.rng.uniform(50.0, 140.0)) * occasion.rng.choice([-1.0, 1.0])
    return _two(occasion, (far, far * occasion.rng.uniform(0.8, 1.2)), turn)


def three_finger_swipe(occasion: Occasion) -> list[Press]:
    """Three fingers side by side in any of the four directions."""
    return swipe(float(occasion.rng.choice([RIGHT, UP, LEFT, DOWN])), 3)(occasion)


SEVERAL: dict[str, Maker] = {
    "two_finger_swipe_left": swipe(LEFT, 2),
    "two_finger_swipe_right": swipe(RIGHT, 2),
    **named(three_finger_swipe, two_finger_tap, drumming, knuckles, pinch, spread, rotation),
}
