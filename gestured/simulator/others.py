"""What one finger does that is none of the ten gestures, and the list of all non-gestures."""

import math
from collections.abc import Callable

import numpy as np

from .gestures import DOWN, LEFT, RIGHT, UP, swipe
from .kinematics import Array, arc, ellipse, grid, polyline, progress, turning, wander
from .people import Artefact, Contact
from .several import drumming, knuckles, pinch, rotation, spread, three_finger_swipe, two_finger_tap
from .strokes import Scene, fingers_on, stroke, swipe_length, touch_down
from .things import (
    electrical_burst,
    forearm,
    heel_rest,
    object_put_down,
    palm,
    sleeve_brush,
    spike,
    wipe,
    wrinkle,
)


def long_press(scene: Scene) -> list[Contact]:
    """A finger that stays for 0.9 s or longer."""
    x, y = scene.spot(3.0, 3.0)
    return [touch_down(scene, x, y, scene.rng.uniform(0.9, 3.0))]


def slow_touch(scene: Scene) -> list[Contact]:
    """A light touch that comes and goes slowly and drifts a little: somebody leans or feels."""
    rng = scene.rng
    x, y = scene.spot(3.0, 3.0)
    t = grid(rng.uniform(0.9, 2.6))
    drift = rng.normal(0.0, 2.0, 2)
    half = 0.48 * float(t[-1])
    return [
        scene.finger(
            t,
            x + drift[0] * t,
            y + drift[1] * t,
            force=rng.uniform(0.2, 0.7),
            fade_in_s=half,
            fade_out_s=half,
        )
    ]


def _drawn(scene: Scene, t: Array, x: Array, y: Array) -> list[Contact]:
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
    return float(
        np.clip(0.3 * (length / 40.0) ** 0.4 / scene.rate * scene.rng.lognormal(0.0, 0.15), 0.11, 0.9)
    )


def _legs(
    scene: Scene, points: list[tuple[float, float]], overlap: float = 0.25, pause_s: float = 0.0
) -> list[Contact]:
    """One finger through via points."""
    legs = [_leg_s(scene, math.dist(a, b)) for a, b in zip(points[:-1], points[1:], strict=True)]
    t, x, y = polyline(points, legs, overlap, pause_s)
    return _drawn(scene, t, x, y)


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


def diagonal_swipe(scene: Scene) -> list[Contact]:
    """A swipe 31 to 59 degrees off the axes."""
    rng = scene.rng
    heading = float(rng.choice([1, 3, 5, 7])) * math.pi / 4
    path = stroke(scene, heading, swipe_length(scene, heading) * 0.8, limit=math.radians(14.0))
    return fingers_on(scene, path, int(rng.choice([1, 2], p=[0.85, 0.15])), heading)


def tap_then_swipe(scene: Scene) -> list[Contact]:
    """A tap, and then a swipe from about there."""
    rng = scene.rng
    heading = float(rng.choice([RIGHT, UP, LEFT, DOWN]))
    path = stroke(scene, heading, swipe_length(scene, heading))
    made = fingers_on(scene, path, 1, heading)
    tap, gap = scene.tap_s(), scene.gap_s()
    moved = made[0]
    shifted = Contact(
        moved.t + tap + gap,
        moved.x,
        moved.y,
        moved.force,
        moved.length,
        moved.width,
        moved.angle,
        moved.growth,
        moved.flatness,
    )
    near = rng.normal(0.0, 0.03, 2) * scene.small
    return [touch_down(scene, float(moved.x[0]) + near[0], float(moved.y[0]) + near[1], tap), shifted]


def press_and_slide(scene: Scene) -> list[Contact]:
    """A finger that holds for 0.9 s or longer and then drags."""
    rng = scene.rng
    heading = rng.uniform(-math.pi, math.pi)
    length = swipe_length(scene, heading) * rng.uniform(0.5, 1.0)
    hold, move, after = rng.uniform(0.9, 2.0), rng.uniform(0.3, 1.2) / scene.rate, rng.uniform(0.0, 0.4)
    t = grid(hold + move + after)
    x, y = arc(progress((t - hold) / move, rng), length, heading, rng.normal(0.0, 0.2))
    return _drawn(scene, t, x, y)


def arc_stroke(scene: Scene) -> list[Contact]:
    """An arc of 95 to 200 degrees: too bent for a swipe, too short for a circle."""
    rng = scene.rng
    bend = math.radians(rng.uniform(95.0, 200.0)) * rng.choice([-1.0, 1.0])
    length = abs(bend) * scene.small * rng.uniform(0.16, 0.4)
    move = float(np.clip(0.55 * (length / 50.0) ** 0.4 / scene.rate, 0.25, 2.0))
    t = grid(move + rng.choice([0.0, 0.2]))
    x, y = arc(progress(t / move, rng), length, rng.uniform(-math.pi, math.pi), bend)
    return _drawn(scene, t, x, y)


def figure_eight(scene: Scene) -> list[Contact]:
    """A lying or standing eight, once or one and a half times."""
    rng = scene.rng
    move = float(np.clip(1.5 / scene.rate * rng.lognormal(0.0, 0.15), 0.8, 4.0))
    t = grid(move)
    phase = (
        2.0
        * math.pi
        * (rng.random() + rng.uniform(0.9, 1.5) * turning(t / move, rng))
        * rng.choice([-1.0, 1.0])
    )
    size = scene.small * rng.uniform(0.22, 0.42)
    x, y = size * np.sin(phase), size * rng.uniform(0.35, 0.6) * np.sin(2.0 * phase)
    angle = rng.choice([0.0, math.pi / 2]) + rng.normal(0.0, 0.3)
    c, s = math.cos(angle), math.sin(angle)
    return _drawn(scene, t, x * c - y * s, x * s + y * c)


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
    x, y = ellipse(
        rng.uniform(0.0, 6.3) + sense * 2.0 * math.pi * turns * u, radius, rng.uniform(1.0, 1.25), 0.5
    )
    return _drawn(scene, t, x, y)


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
    return _drawn(scene, t, x + drift[0] * t, y + drift[1] * t)


def triple_tap(scene: Scene) -> list[Contact]:
    """Three or four taps in a row at about one place."""
    rng = scene.rng
    x, y = scene.spot(4.0, 4.0)
    made, start = [], 0.0
    for _ in range(int(rng.choice([3, 4], p=[0.75, 0.25]))):
        duration = scene.tap_s()
        dx, dy = rng.normal(0.0, 0.025, 2) * scene.small
        made.append(touch_down(scene, x + dx, y + dy, duration, start))
        start += duration + max(scene.gap_s(), 0.11)
    return made


def taps_apart(scene: Scene) -> list[Contact]:
    """Two taps as close in time as a double tap, but at places a third of the pad or more apart."""
    rng = scene.rng
    apart = scene.small * rng.uniform(0.38, 0.7)
    angle = rng.uniform(-math.pi, math.pi)
    dx, dy = 0.5 * apart * math.cos(angle), 0.5 * apart * math.sin(angle)
    x, y = scene.spot(abs(dx), abs(dy))
    first = scene.tap_s()
    return [
        touch_down(scene, x - dx, y - dy, first),
        touch_down(scene, x + dx, y + dy, scene.tap_s(), first + scene.gap_s()),
    ]


def tap_then_hold(scene: Scene) -> list[Contact]:
    """A tap, and then a press of 0.9 s or longer at the same place."""
    rng = scene.rng
    x, y = scene.spot(3.0, 3.0)
    first = scene.tap_s()
    dx, dy = rng.normal(0.0, 0.03, 2) * scene.small
    return [
        touch_down(scene, x, y, first),
        touch_down(scene, x + dx, y + dy, rng.uniform(0.9, 2.0), first + scene.gap_s()),
    ]


def wave(scene: Scene) -> list[Contact]:
    """A wavy line: one to three periods of a sine along any direction, clearly swinging."""
    rng = scene.rng
    periods, length = rng.uniform(1.0, 3.0), scene.small * rng.uniform(0.5, 0.9)
    t = grid(float(np.clip(0.55 * (1.0 + periods) / scene.rate * rng.lognormal(0.0, 0.15), 0.4, 3.0)))
    s = progress(t / t[-1], rng)
    x = length * s
    y = scene.small * rng.uniform(0.12, 0.25) * np.sin(2.0 * math.pi * periods * s + rng.uniform(0.0, 6.3))
    angle = rng.uniform(-math.pi, math.pi)
    return _drawn(
        scene, t, x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)
    )


Made = list[Contact] | list[Artefact]

OTHERS: dict[str, Callable[[Scene], Made]] = {
    "long_press": long_press,
    "slow_touch": slow_touch,
    "triple_tap": triple_tap,
    "taps_apart": taps_apart,
    "tap_then_hold": tap_then_hold,
    "tap_then_swipe": tap_then_swipe,
    "press_and_slide": press_and_slide,
    "diagonal_swipe": diagonal_swipe,
    "back_and_forth": back_and_forth,
    "check_mark": check_mark,
    "corner": corner,
    "zigzag": zigzag,
    "wave": wave,
    "scribble": scribble,
    "arc": arc_stroke,
    "figure_eight": figure_eight,
    "spiral": spiral,
    "rubbing": rubbing,
    "two_finger_swipe_left": swipe(LEFT, 2),
    "two_finger_swipe_right": swipe(RIGHT, 2),
    "three_finger_swipe": three_finger_swipe,
    "two_finger_tap": two_finger_tap,
    "drumming": drumming,
    "knuckles": knuckles,
    "pinch": pinch,
    "spread": spread,
    "rotation": rotation,
    "palm": palm,
    "heel_rest": heel_rest,
    "forearm": forearm,
    "wipe": wipe,
    "object_put_down": object_put_down,
    "sleeve_brush": sleeve_brush,
    "wrinkle": wrinkle,
    "electrical_burst": electrical_burst,
    "spike": spike,
}
