"""Lines drawn with one finger that are none of the ten gestures."""

import math
from itertools import pairwise

import numpy as np

from gestured.simulator.gestures import DOWN, LEFT, RIGHT, UP
from gestured.simulator.kinematics import Array, ellipse, grid, polyline, stroke_progress, turned, turning, wander
from gestured.simulator.kinematics import arc as along_arc
from gestured.simulator.occasion import Maker, Occasion, named
from gestured.simulator.people import Press


def drawn(occasion: Occasion, t: Array, x: Array, y: Array) -> list[Press]:
    """One finger along a path (mm) that is moved onto the pad, with this person's unsteadiness."""
    x, y = occasion.settle(x, y)
    sway = 0.7 * occasion.person.wobble_mm * min(1.0, occasion.small / 60.0)
    x = x + sway * wander(t, occasion.rng, 0.4, 3.0, 3)
    y = y + sway * wander(t, occasion.rng, 0.4, 3.0, 3)
    return [occasion.finger(t, x, y)]


def _turned(points: list[tuple[float, float]], angle: float) -> list[tuple[float, float]]:
    return [turned(x, y, angle) for x, y in points]


def _legs(occasion: Occasion, points: list[tuple[float, float]], overlap: float, pause_s: float = 0.0) -> list[Press]:
    """One finger through via points (mm), with legs that overlap or pause as in `polyline`."""
    lengths = [math.dist(a, b) for a, b in pairwise(points)]
    usual = [0.3 * (length / 40.0) ** 0.4 / occasion.rate for length in lengths]  # s for each leg, but for chance
    legs = [float(np.clip(leg_s * occasion.rng.lognormal(0.0, 0.15), 0.11, 0.9)) for leg_s in usual]
    t, x, y = polyline(points, legs, overlap, pause_s)
    return drawn(occasion, t, x, y)


def scribble(occasion: Occasion) -> list[Press]:
    """A wild line through six to thirteen places."""
    rng = occasion.rng
    size = occasion.small * rng.uniform(0.25, 0.8)
    points = [(float(a), float(b)) for a, b in rng.uniform(-0.5, 0.5, (int(rng.integers(6, 14)), 2)) * size]
    return _legs(occasion, points, overlap=rng.uniform(0.1, 0.45))


def zigzag(occasion: Occasion) -> list[Press]:
    """Three to six straight legs to and fro while moving on."""
    rng = occasion.rng
    legs = int(rng.integers(3, 7))
    tall, step = occasion.small * rng.uniform(0.25, 0.65), occasion.small * rng.uniform(0.1, 0.28)
    points = [(step * k, tall * (k % 2) * rng.uniform(0.8, 1.2)) for k in range(legs + 1)]
    return _legs(occasion, _turned(points, rng.uniform(-math.pi, math.pi)), overlap=rng.uniform(0.05, 0.35))


def check_mark(occasion: Occasion) -> list[Press]:
    """A short stroke down to the right and a longer one up to the right, or mirrored, as left-handers draw it."""
    rng = occasion.rng
    size = occasion.small * rng.uniform(0.3, 0.8)
    short, tall = size * rng.uniform(0.3, 0.55), size
    down, up = math.radians(rng.uniform(30.0, 75.0)), math.radians(rng.uniform(35.0, 70.0))
    flip = -1.0 if rng.random() < 0.2 else 1.0
    points = [
        (-flip * short * math.cos(down), short * math.sin(down)),
        (0.0, 0.0),
        (flip * tall * math.cos(up), tall * math.sin(up)),
    ]
    return _legs(occasion, points, overlap=rng.uniform(0.05, 0.3))


def corner(occasion: Occasion) -> list[Press]:
    """An L: two strokes at about a right angle."""
    rng = occasion.rng
    first, second = occasion.small * rng.uniform(0.3, 0.7, 2)
    turn = rng.choice([-1.0, 1.0]) * math.radians(rng.uniform(70.0, 110.0))
    points = [(0.0, 0.0), (first, 0.0), (first + second * math.cos(turn), second * math.sin(turn))]
    base = float(rng.choice([RIGHT, UP, LEFT, DOWN])) + rng.normal(0.0, 0.15)
    return _legs(occasion, _turned(points, base), overlap=rng.uniform(0.0, 0.25), pause_s=rng.choice([0.0, 0.1]))


def back_and_forth(occasion: Occasion) -> list[Press]:
    """A swipe that goes to and fro, in two to five legs."""
    rng = occasion.rng
    length = occasion.small * rng.uniform(0.3, 0.8)
    points = [(0.0, 0.0)]
    for k in range(int(rng.integers(2, 6))):
        points.append((length * rng.uniform(0.85, 1.1) * (1 - k % 2), rng.normal(0.0, 0.04) * length))
    return _legs(occasion, _turned(points, rng.uniform(-math.pi, math.pi)), overlap=rng.uniform(0.0, 0.25))


def wave(occasion: Occasion) -> list[Press]:
    """A wavy line in any direction: one to three periods of a sine with a clear amplitude."""
    rng = occasion.rng
    periods, length = rng.uniform(1.0, 3.0), occasion.small * rng.uniform(0.5, 0.9)
    t = grid(float(np.clip(0.55 * (1.0 + periods) / occasion.rate * rng.lognormal(0.0, 0.15), 0.4, 3.0)))
    s = stroke_progress(t / t[-1], rng)
    x = length * s
    y = occasion.small * rng.uniform(0.12, 0.25) * np.sin(2.0 * math.pi * periods * s + rng.uniform(0.0, 6.3))
    return drawn(occasion, t, *turned(x, y, rng.uniform(-math.pi, math.pi)))


def arc(occasion: Occasion) -> list[Press]:
    """An arc of 95 to 200 degrees: too bent for a swipe, too short for a circle."""
    rng = occasion.rng
    bend = math.radians(rng.uniform(95.0, 200.0)) * rng.choice([-1.0, 1.0])
    length = abs(bend) * occasion.small * rng.uniform(0.16, 0.4)
    move = float(np.clip(0.55 * (length / 50.0) ** 0.4 / occasion.rate, 0.25, 2.0))
    t = grid(move + rng.choice([0.0, 0.2]))
    x, y = along_arc(stroke_progress(t / move, rng), length, rng.uniform(-math.pi, math.pi), bend)
    return drawn(occasion, t, x, y)


def figure_eight(occasion: Occasion) -> list[Press]:
    """A lying or standing eight, 0.9 to 1.5 times."""
    rng = occasion.rng
    move = float(np.clip(1.5 / occasion.rate * rng.lognormal(0.0, 0.15), 0.8, 4.0))
    t = grid(move)
    phase = 2.0 * math.pi * (rng.random() + rng.uniform(0.9, 1.5) * turning(t / move, rng)) * rng.choice([-1.0, 1.0])
    size = occasion.small * rng.uniform(0.22, 0.42)
    x, y = size * np.sin(phase), size * rng.uniform(0.35, 0.6) * np.sin(2.0 * phase)
    return drawn(occasion, t, *turned(x, y, rng.choice([0.0, math.pi / 2]) + rng.normal(0.0, 0.3)))


def spiral(occasion: Occasion) -> list[Press]:
    """Two or three turns, while the radius grows or shrinks by a factor of three or more."""
    rng = occasion.rng
    turns = rng.uniform(1.9, 3.2)
    move = float(np.clip(0.75 * turns / occasion.rate * rng.lognormal(0.0, 0.15), 1.0, 5.0))
    t = grid(move)
    u = t / move
    radius = occasion.small * rng.uniform(0.25, 0.45) * (rng.uniform(0.1, 0.35) + 0.65 * u)
    if rng.random() < 0.5:
        radius = radius[::-1]
    sense = rng.choice([-1.0, 1.0])
    x, y = ellipse(rng.uniform(0.0, 6.3) + sense * 2.0 * math.pi * turns * u, radius, rng.uniform(1.0, 1.25), 0.5)
    return drawn(occasion, t, x, y)


def rubbing(occasion: Occasion) -> list[Press]:
    """Two to five turns on one spot, as if rubbing."""
    rng = occasion.rng
    turns = rng.uniform(2.0, 5.0)
    move = float(np.clip(0.55 * turns / occasion.rate, 0.9, 4.0))
    t = grid(move)
    phase = rng.uniform(0.0, 6.3) + rng.choice([-1.0, 1.0]) * 2.0 * math.pi * turns * t / move
    drift = rng.normal(0.0, 4.0, 2)
    radius = np.full_like(t, occasion.small * rng.uniform(0.08, 0.25))
    x, y = ellipse(phase, radius, rng.uniform(1.0, 3.0), rng.uniform(0.0, 3.1))
    return drawn(occasion, t, x + drift[0] * t, y + drift[1] * t)


DRAWN: dict[str, Maker] = named(
    back_and_forth, check_mark, corner, zigzag, wave, scribble, arc, figure_eight, spiral, rubbing
)
