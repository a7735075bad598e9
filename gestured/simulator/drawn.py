"""Lines that one finger draws and that are none of the ten gestures."""

import math

import numpy as np

from gestured.simulator.gestures import DOWN, LEFT, RIGHT, UP
from gestured.simulator.kinematics import Array, arc, ellipse, grid, polyline, progress, turning, wander
from gestured.simulator.people import Contact
from gestured.simulator.strokes import Scene


def drawn(scene: Scene, t: Array, x: Array, y: Array) -> list[Contact]:
    """One finger along a path, settled on the pad, as unsteady as this hand is."""
    x, y = scene.settle(x, y)
    sway = 0.7 * scene.person.wobble_mm * min(1.0, scene.small / 60.0)
    x = x + sway * wander(t, scene.rng, 0.4, 3.0, 3)
    y = y + sway * wander(t, scene.rng, 0.4, 3.0, 3)
    return [scene.finger(t, x, y)]


def _turned(points: list[tuple[float, float]], angle: float) -> list[tuple[float, float]]:
    """Points turned about the origin."""
    c, s = math.cos(angle), math.sin(angle)
    return [(x * c - y * s, x * s + y * c) for x, y in points]


def _leg_s(scene: Scene, length: float) -> float:
    """A duration for one leg of that many millimetres, in seconds."""
    return float(np.clip(0.3 * (length / 40.0) ** 0.4 / scene.rate * scene.rng.lognormal(0.0, 0.15), 0.11, 0.9))


def _legs(
    scene: Scene, points: list[tuple[float, float]], overlap: float = 0.25, pause_s: float = 0.0
) -> list[Contact]:
    """One finger through via points."""
    legs = [_leg_s(scene, math.dist(a, b)) for a, b in zip(points[:-1], points[1:], strict=True)]
    t, x, y = polyline(points, legs, overlap, pause_s)
    return drawn(scene, t, x, y)


def scribble(scene: Scene) -> list[Contact]:
    """A wild line through five to thirteen places."""
    rng = scene.rng
    size = scene.small * rng.uniform(0.25, 0.8)
    points = [(float(a), float(b)) for a, b in rng.uniform(-0.5, 0.5, (int(rng.integers(6, 14)), 2)) * size]
    return _legs(scene, points, overlap=rng.uniform(0.1, 0.45))


def zigzag(scene: Scene) -> list[Contact]:
    """Three to six straight legs to and fro while moving on."""
    rng = scene.rng
    legs = int(rng.integers(3, 7))
    tall, step = scene.small * rng.uniform(0.25, 0.65), scene.small * rng.uniform(0.1, 0.28)
    points = [(step * k, tall * (k % 2) * rng.uniform(0.8, 1.2)) for k in range(legs + 1)]
    return _legs(scene, _turned(points, rng.uniform(-math.pi, math.pi)), overlap=rng.uniform(0.05, 0.35))


def check_mark(scene: Scene) -> list[Contact]:
    """A short stroke down to the right and a longer one up to the right (or as left-handers draw it)."""
    rng = scene.rng
    size = scene.small * rng.uniform(0.3, 0.8)
    short, tall = size * rng.uniform(0.3, 0.55), size
    down, up = math.radians(rng.uniform(30.0, 75.0)), math.radians(rng.uniform(35.0, 70.0))
    flip = -1.0 if rng.random() < 0.2 else 1.0
    points = [
        (-flip * short * math.cos(down), short * math.sin(down)),
        (0.0, 0.0),
        (flip * tall * math.cos(up), tall * math.sin(up)),
    ]
    return _legs(scene, points, overlap=rng.uniform(0.05, 0.3))


def corner(scene: Scene) -> list[Contact]:
    """An L: two strokes at about a right angle."""
    rng = scene.rng
    first, second = scene.small * rng.uniform(0.3, 0.7, 2)
    turn = rng.choice([-1.0, 1.0]) * math.radians(rng.uniform(70.0, 110.0))
    points = [(0.0, 0.0), (first, 0.0), (first + second * math.cos(turn), second * math.sin(turn))]
    base = float(rng.choice([RIGHT, UP, LEFT, DOWN])) + rng.normal(0.0, 0.15)
    return _legs(scene, _turned(points, base), overlap=rng.uniform(0.0, 0.25), pause_s=rng.choice([0.0, 0.1]))


def back_and_forth(scene: Scene) -> list[Contact]:
    """A swipe that comes back, once or several times."""
    rng = scene.rng
    length = scene.small * rng.uniform(0.3, 0.8)
    points = [(0.0, 0.0)]
    for k in range(int(rng.integers(2, 6))):
        points.append((length * rng.uniform(0.85, 1.1) * (1 - k % 2), rng.normal(0.0, 0.04) * length))
    return _legs(scene, _turned(points, rng.uniform(-math.pi, math.pi)), overlap=rng.uniform(0.0, 0.25))


def wave(scene: Scene) -> list[Contact]:
    """A wavy line: one to three periods of a sine along any direction, clearly swinging."""
    rng = scene.rng
    periods, length = rng.uniform(1.0, 3.0), scene.small * rng.uniform(0.5, 0.9)
    t = grid(float(np.clip(0.55 * (1.0 + periods) / scene.rate * rng.lognormal(0.0, 0.15), 0.4, 3.0)))
    s = progress(t / t[-1], rng)
    x = length * s
    y = scene.small * rng.uniform(0.12, 0.25) * np.sin(2.0 * math.pi * periods * s + rng.uniform(0.0, 6.3))
    angle = rng.uniform(-math.pi, math.pi)
    return drawn(scene, t, x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle))


def arc_stroke(scene: Scene) -> list[Contact]:
    """An arc of 95 to 200 degrees: too bent for a swipe, too short for a circle."""
    rng = scene.rng
    bend = math.radians(rng.uniform(95.0, 200.0)) * rng.choice([-1.0, 1.0])
    length = abs(bend) * scene.small * rng.uniform(0.16, 0.4)
    move = float(np.clip(0.55 * (length / 50.0) ** 0.4 / scene.rate, 0.25, 2.0))
    t = grid(move + rng.choice([0.0, 0.2]))
    x, y = arc(progress(t / move, rng), length, rng.uniform(-math.pi, math.pi), bend)
    return drawn(scene, t, x, y)


def figure_eight(scene: Scene) -> list[Contact]:
    """A lying or standing eight, once or one and a half times."""
    rng = scene.rng
    move = float(np.clip(1.5 / scene.rate * rng.lognormal(0.0, 0.15), 0.8, 4.0))
    t = grid(move)
    phase = 2.0 * math.pi * (rng.random() + rng.uniform(0.9, 1.5) * turning(t / move, rng)) * rng.choice([-1.0, 1.0])
    size = scene.small * rng.uniform(0.22, 0.42)
    x, y = size * np.sin(phase), size * rng.uniform(0.35, 0.6) * np.sin(2.0 * phase)
    angle = rng.choice([0.0, math.pi / 2]) + rng.normal(0.0, 0.3)
    c, s = math.cos(angle), math.sin(angle)
    return drawn(scene, t, x * c - y * s, x * s + y * c)


def spiral(scene: Scene) -> list[Contact]:
    """Two or more turns while the radius grows or shrinks to a third."""
    rng = scene.rng
    turns = rng.uniform(1.9, 3.2)
    move = float(np.clip(0.75 * turns / scene.rate * rng.lognormal(0.0, 0.15), 1.0, 5.0))
    t = grid(move)
    u = t / move
    radius = scene.small * rng.uniform(0.25, 0.45) * (rng.uniform(0.1, 0.35) + 0.65 * u)
    if rng.random() < 0.5:
        radius = radius[::-1]
    sense = rng.choice([-1.0, 1.0])
    x, y = ellipse(rng.uniform(0.0, 6.3) + sense * 2.0 * math.pi * turns * u, radius, rng.uniform(1.0, 1.25), 0.5)
    return drawn(scene, t, x, y)


def rubbing(scene: Scene) -> list[Contact]:
    """Rubbing round and round, two to five turns on one spot."""
    rng = scene.rng
    turns = rng.uniform(2.0, 5.0)
    move = float(np.clip(0.55 * turns / scene.rate, 0.9, 4.0))
    t = grid(move)
    phase = rng.uniform(0.0, 6.3) + rng.choice([-1.0, 1.0]) * 2.0 * math.pi * turns * t / move
    drift = rng.normal(0.0, 4.0, 2)
    radius = np.full_like(t, scene.small * rng.uniform(0.08, 0.25))
    x, y = ellipse(phase, radius, rng.uniform(1.0, 3.0), rng.uniform(0.0, 3.1))
    return drawn(scene, t, x + drift[0] * t, y + drift[1] * t)
