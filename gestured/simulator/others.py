"""What people, sleeves, things and electronics do to a pad that is none of the ten gestures."""

import math
from collections.abc import Callable

import numpy as np

from .gestures import DOWN, LEFT, RIGHT, UP, swipe
from .kinematics import Array, arc, ellipse, grid, polyline, progress, turning, wander
from .people import Artefact, Contact
from .strokes import Scene, blob, fingers_on, stroke, swipe_length, touch_down

Made = list[Contact] | list[Artefact]


def long_press(scene: Scene) -> Made:
    """A finger that stays for 0.9 s or longer."""
    x, y = scene.spot(3.0, 3.0)
    return [touch_down(scene, x, y, scene.rng.uniform(0.9, 3.0))]


def slow_touch(scene: Scene) -> Made:
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


def palm(scene: Scene) -> Made:
    """A flat hand: three to seven large contacts that land within 0.15 s."""
    rng = scene.rng
    total = rng.uniform(0.2, 2.2)
    cx, cy = scene.spot(0.1 * scene.width, 0.1 * scene.height)
    spread = rng.uniform(0.15, 0.36) * scene.small
    made = []
    for _ in range(int(rng.integers(3, 8))):
        first = rng.uniform(0.0, min(0.15, 0.3 * total))
        t = grid(total - first)
        slide = rng.normal(0.0, 3.0, 2)
        made.append(
            blob(
                scene,
                t,
                cx + rng.normal(0.0, spread) + slide[0] * t,
                cy + rng.normal(0.0, spread) + slide[1] * t,
                scene.person.force * rng.uniform(0.5, 2.5),
                rng.uniform(5.0, 13.0),
                rng.uniform(4.0, 9.0),
                rng.uniform(0.0, math.pi),
                start=first,
                rise_s=rng.uniform(0.03, 0.2),
            )
        )
    return made


def heel_rest(scene: Scene) -> Made:
    """The heel of the hand lies on an edge for seconds, heavy and large."""
    rng = scene.rng
    t = grid(rng.uniform(1.0, 4.0))
    edge = rng.uniform(-0.5, 0.5)
    places = [(edge, -0.42), (edge, 0.42), (-0.42, edge), (0.42, edge)]
    px, py = places[int(rng.choice(4, p=[0.55, 0.1, 0.15, 0.2]))]
    x, y = scene.width * (0.5 + px), scene.height * (0.5 + py)
    sway = rng.uniform(0.2, 2.0)
    made = [
        blob(
            scene,
            t,
            x + sway * wander(t, rng, 0.2, 1.0),
            y + sway * wander(t, rng, 0.2, 1.0),
            rng.uniform(1.0, 6.0),
            rng.uniform(9.0, 18.0),
            rng.uniform(6.0, 11.0),
            rng.uniform(0.0, math.pi),
            rise_s=rng.uniform(0.05, 0.4),
            fall_s=rng.uniform(0.05, 0.4),
        )
    ]
    if rng.random() < 0.4:
        made.append(
            blob(
                scene,
                t,
                x + rng.normal(0.0, 22.0),
                y + rng.normal(0.0, 12.0),
                rng.uniform(0.5, 3.0),
                rng.uniform(6.0, 12.0),
                rng.uniform(5.0, 9.0),
                0.3,
            )
        )
    return made


def forearm(scene: Scene) -> Made:
    """An arm laid across the pad: a long band, coming and going slowly, sometimes rolling."""
    rng = scene.rng
    t = grid(rng.uniform(0.6, 3.5))
    x, y = scene.spot(0.1 * scene.width, 0.1 * scene.height)
    roll = rng.normal(0.0, 0.12, 2) * scene.small * (t / t[-1])[:, None]
    return [
        blob(
            scene,
            t,
            x + roll[:, 0],
            y + roll[:, 1],
            rng.uniform(2.0, 9.0),
            rng.uniform(0.3, 0.7) * scene.small,
            rng.uniform(7.0, 16.0),
            rng.uniform(0.0, math.pi),
            rise_s=rng.uniform(0.1, 0.6),
            fall_s=rng.uniform(0.1, 0.6),
        )
    ]


def knuckles(scene: Scene) -> Made:
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


def _drawn(scene: Scene, t: Array, x: Array, y: Array) -> Made:
    """One finger along a path, settled on the pad."""
    x, y = scene.settle(x, y)
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
) -> Made:
    """One finger through via points."""
    legs = [_leg_s(scene, math.dist(a, b)) for a, b in zip(points[:-1], points[1:], strict=True)]
    t, x, y = polyline(points, legs, overlap, pause_s)
    return _drawn(scene, t, x, y)


def scribble(scene: Scene) -> Made:
    """A wild line through five to thirteen places."""
    rng = scene.rng
    size = scene.small * rng.uniform(0.25, 0.8)
    points = [(float(a), float(b)) for a, b in rng.uniform(-0.5, 0.5, (int(rng.integers(6, 14)), 2)) * size]
    return _legs(scene, points, overlap=rng.uniform(0.1, 0.45))


def zigzag(scene: Scene) -> Made:
    """Three to six straight legs to and fro while moving on."""
    rng = scene.rng
    legs = int(rng.integers(3, 7))
    tall, step = scene.small * rng.uniform(0.25, 0.65), scene.small * rng.uniform(0.1, 0.28)
    points = [(step * k, tall * (k % 2) * rng.uniform(0.8, 1.2)) for k in range(legs + 1)]
    return _legs(scene, _turned(points, rng.uniform(-math.pi, math.pi)), overlap=rng.uniform(0.05, 0.35))


def check_mark(scene: Scene) -> Made:
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


def corner(scene: Scene) -> Made:
    """An L: two strokes at about a right angle."""
    rng = scene.rng
    first, second = scene.small * rng.uniform(0.3, 0.7, 2)
    turn = rng.choice([-1.0, 1.0]) * math.radians(rng.uniform(70.0, 110.0))
    points = [(0.0, 0.0), (first, 0.0), (first + second * math.cos(turn), second * math.sin(turn))]
    base = float(rng.choice([RIGHT, UP, LEFT, DOWN])) + rng.normal(0.0, 0.15)
    return _legs(scene, _turned(points, base), overlap=rng.uniform(0.0, 0.25), pause_s=rng.choice([0.0, 0.1]))


def back_and_forth(scene: Scene) -> Made:
    """A swipe that comes back, once or several times."""
    rng = scene.rng
    length = scene.small * rng.uniform(0.3, 0.8)
    points = [(0.0, 0.0)]
    for k in range(int(rng.integers(2, 6))):
        points.append((length * rng.uniform(0.85, 1.1) * (1 - k % 2), rng.normal(0.0, 0.04) * length))
    return _legs(scene, _turned(points, rng.uniform(-math.pi, math.pi)), overlap=rng.uniform(0.0, 0.25))


def diagonal_swipe(scene: Scene) -> Made:
    """A swipe 32 to 58 degrees off the axes."""
    rng = scene.rng
    heading = float(rng.choice([1, 3, 5, 7])) * math.pi / 4
    path = stroke(scene, heading, swipe_length(scene, heading) * 0.8, limit=math.radians(11.0))
    return fingers_on(scene, path, int(rng.choice([1, 2], p=[0.85, 0.15])), heading)


def three_finger_swipe(scene: Scene) -> Made:
    """Three fingers side by side in any of the four directions."""
    return swipe(float(scene.rng.choice([RIGHT, UP, LEFT, DOWN])), 3)(scene)


def tap_then_swipe(scene: Scene) -> Made:
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


def press_and_slide(scene: Scene) -> Made:
    """A finger that holds for 0.9 s or longer and then drags."""
    rng = scene.rng
    heading = rng.uniform(-math.pi, math.pi)
    length = swipe_length(scene, heading) * rng.uniform(0.5, 1.0)
    hold, move, after = rng.uniform(0.9, 2.0), rng.uniform(0.3, 1.2) / scene.rate, rng.uniform(0.0, 0.4)
    t = grid(hold + move + after)
    x, y = arc(progress((t - hold) / move, rng), length, heading, rng.normal(0.0, 0.2))
    return _drawn(scene, t, x, y)


def curve(scene: Scene) -> Made:
    """An arc of 95 to 200 degrees: too bent for a swipe, too short for a circle."""
    rng = scene.rng
    bend = math.radians(rng.uniform(95.0, 200.0)) * rng.choice([-1.0, 1.0])
    length = abs(bend) * scene.small * rng.uniform(0.16, 0.4)
    move = float(np.clip(0.55 * (length / 50.0) ** 0.4 / scene.rate, 0.25, 2.0))
    t = grid(move + rng.choice([0.0, 0.2]))
    x, y = arc(progress(t / move, rng), length, rng.uniform(-math.pi, math.pi), bend)
    return _drawn(scene, t, x, y)


def figure_eight(scene: Scene) -> Made:
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


def spiral(scene: Scene) -> Made:
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


def rubbing(scene: Scene) -> Made:
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


def triple_tap(scene: Scene) -> Made:
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


def drumming(scene: Scene) -> Made:
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


def two_finger_tap(scene: Scene) -> Made:
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


def _two(scene: Scene, distance: tuple[float, float], turn: float) -> Made:
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


def pinch(scene: Scene) -> Made:
    """Two fingers move together."""
    far = scene.small * scene.rng.uniform(0.45, 0.85)
    return _two(scene, (far, far * scene.rng.uniform(0.15, 0.45)), scene.rng.normal(0.0, 0.25))


def spread(scene: Scene) -> Made:
    """Two fingers move apart."""
    far = scene.small * scene.rng.uniform(0.45, 0.85)
    return _two(scene, (far * scene.rng.uniform(0.15, 0.45), far), scene.rng.normal(0.0, 0.25))


def rotation(scene: Scene) -> Made:
    """Two fingers turn about their middle by 50 to 140 degrees."""
    far = scene.small * scene.rng.uniform(0.35, 0.7)
    turn = math.radians(scene.rng.uniform(50.0, 140.0)) * scene.rng.choice([-1.0, 1.0])
    return _two(scene, (far, far * scene.rng.uniform(0.8, 1.2)), turn)


def object_put_down(scene: Scene) -> Made:
    """A thing is put down: cup ring, phone edge, key, bottle. Hard edges, no tremor, stays for 0.4 s to 5 s."""
    rng = scene.rng
    total = rng.uniform(0.4, 5.0)
    t = grid(total)
    x, y = scene.spot(0.1 * scene.width, 0.1 * scene.height, beyond=0.2)
    form = int(rng.integers(0, 4))
    made = []
    hit = 1.0 + rng.uniform(0.0, 1.5) * np.exp(-t / 0.05)  # the blow when it lands
    force = rng.uniform(0.4, 4.0)
    parts: list[tuple[float, float, float, float, float]] = []
    if form == 0:
        radius = rng.uniform(12.0, 38.0)
        count = int(rng.integers(6, 13))
        for k in range(count):
            a = 2.0 * math.pi * k / count
            parts.append((radius * math.cos(a), radius * math.sin(a), 4.0, 3.0, rng.uniform(0.2, 1.0)))
    elif form == 1:
        angle = rng.uniform(0.0, math.pi)
        for k in range(2):
            parts.append((rng.normal(0.0, 20.0), rng.normal(0.0, 20.0), rng.uniform(10.0, 25.0), 3.0, 1.0))
        x, y = x + 3.0 * math.cos(angle), y + 3.0 * math.sin(angle)
    elif form == 2:
        parts.append((0.0, 0.0, rng.uniform(8.0, 25.0), rng.uniform(8.0, 20.0), 2.0))
    else:
        for _ in range(int(rng.integers(1, 5))):
            parts.append(
                (
                    rng.normal(0.0, 12.0),
                    rng.normal(0.0, 12.0),
                    rng.uniform(2.0, 6.0),
                    rng.uniform(2.0, 4.0),
                    1.0,
                )
            )
    for dx, dy, length, width, share in parts:
        part = blob(
            scene,
            t,
            x + dx,
            y + dy,
            force * share,
            length,
            width,
            rng.uniform(0.0, math.pi),
            rise_s=rng.uniform(0.01, 0.06),
            fall_s=rng.uniform(0.03, 0.2),
            unrest=0.01,
            flatness=2.5,
        )
        made.append(
            Contact(
                part.t,
                part.x,
                part.y,
                part.force * hit,
                part.length,
                part.width,
                part.angle,
                0.05,
                2.5,
                False,
            )
        )
    return made


def sleeve_brush(scene: Scene) -> Made:
    """Cloth brushes over: one to four weak, large, ragged patches that wander across in 0.3 to 1.8 s."""
    rng = scene.rng
    total = rng.uniform(0.3, 1.8)
    heading = rng.uniform(-math.pi, math.pi)
    across = rng.uniform(0.5, 1.6) * scene.small
    made = []
    for _ in range(int(rng.integers(1, 5))):
        first = rng.uniform(0.0, 0.3) * total
        t = grid(total - first)
        u = t / t[-1] - 0.5
        x = (
            scene.width * rng.uniform(0.25, 0.75)
            + across * u * math.cos(heading)
            + 4.0 * wander(t, rng, 0.5, 3.0)
        )
        y = (
            scene.height * rng.uniform(0.25, 0.75)
            + across * u * math.sin(heading)
            + 4.0 * wander(t, rng, 0.5, 3.0)
        )
        made.append(
            blob(
                scene,
                t,
                x,
                y,
                rng.uniform(0.3, 2.2),
                rng.uniform(7.0, 24.0),
                rng.uniform(3.5, 10.0),
                rng.uniform(0.0, math.pi),
                start=first,
                rise_s=rng.uniform(0.05, 0.5),
                fall_s=rng.uniform(0.05, 0.5),
                unrest=rng.uniform(0.2, 0.8),
            )
        )
    return made


def wrinkle(scene: Scene) -> Made:
    """The fabric is pulled: a long ridge appears along a fold, shifts, and relaxes."""
    rng = scene.rng
    t = grid(rng.uniform(0.4, 3.0))
    x, y = scene.spot(0.1 * scene.width, 0.1 * scene.height)
    slide = rng.normal(0.0, 8.0, 2) * (t / t[-1])[:, None]
    return [
        blob(
            scene,
            t,
            x + slide[:, 0],
            y + slide[:, 1],
            rng.uniform(0.8, 5.0),
            rng.uniform(0.25, 0.8) * scene.small,
            rng.uniform(3.0, 6.0),
            rng.uniform(0.0, math.pi),
            rise_s=rng.uniform(0.05, 0.8),
            fall_s=rng.uniform(0.1, 1.0),
            unrest=rng.uniform(0.05, 0.4),
        )
    ]


def electrical_burst(scene: Scene) -> Made:
    """Interference for 0.05 to 1.5 s: on everything, on rows, columns, blocks, or scattered."""
    rng = scene.rng
    made, start = [], 0.0
    for _ in range(int(rng.integers(1, 5))):
        stop = start + rng.uniform(0.04, 0.6)
        form = str(rng.choice(["all", "row", "column", "block", "taxels"]))
        made.append(
            Artefact(
                start, stop, form, rng.uniform(0.2, 2.0) * rng.choice([1.0, 1.0, -1.0]), rng.uniform(0.2, 1.0)
            )
        )
        start = stop + rng.uniform(0.0, 0.2)
    return made


def spike(scene: Scene) -> Made:
    """One taxel jumps for one frame or a few."""
    rng = scene.rng
    return [Artefact(0.0, rng.uniform(0.02, 0.2), "taxel", rng.uniform(0.4, 4.0), 0.3)]


OTHERS: dict[str, Callable[[Scene], Made]] = {
    "long_press": long_press,
    "slow_touch": slow_touch,
    "palm": palm,
    "heel_rest": heel_rest,
    "forearm": forearm,
    "knuckles": knuckles,
    "scribble": scribble,
    "zigzag": zigzag,
    "check_mark": check_mark,
    "corner": corner,
    "back_and_forth": back_and_forth,
    "diagonal_swipe": diagonal_swipe,
    "two_finger_swipe_left": swipe(LEFT, 2),
    "two_finger_swipe_right": swipe(RIGHT, 2),
    "three_finger_swipe": three_finger_swipe,
    "tap_then_swipe": tap_then_swipe,
    "press_and_slide": press_and_slide,
    "arc": curve,
    "figure_eight": figure_eight,
    "spiral": spiral,
    "rubbing": rubbing,
    "triple_tap": triple_tap,
    "drumming": drumming,
    "two_finger_tap": two_finger_tap,
    "pinch": pinch,
    "spread": spread,
    "rotation": rotation,
    "object_put_down": object_put_down,
    "sleeve_brush": sleeve_brush,
    "wrinkle": wrinkle,
    "electrical_burst": electrical_burst,
    "spike": spike,
}
