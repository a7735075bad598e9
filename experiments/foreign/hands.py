"""Hands of the independent generator: what fingers do, as pads of pressure points moving in continuous time.

Nothing here is shared with, or was copied from, the simulator that the models are trained on. Paths are drawn as a
person would draw them on paper: a few control points, shaken, joined by a spline and followed at a speed with a
trapezoid profile. Coordinates are taxels of a 9 x 9 sheet: x to the right, y down (a row number), 0 to 8.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rng = np.random.Generator

GESTURES: tuple[str, ...] = (
    "one_tap",
    "double_tap",
    "swipe_down",
    "swipe_up",
    "swipe_right",
    "swipe_left",
    "circle_clockwise",
    "circle_counter_clockwise",
    "swipe_up_two_fingers",
    "swipe_down_two_fingers",
)
NON_GESTURES: tuple[str, ...] = (
    "long_press",
    "palm",
    "scribble",
    "zigzag",
    "pinch",
    "two_finger_tap",
    "object",
    "sleeve",
    "burst",
    "check_mark",
    "two_finger_sideways",
    "diagonal_swipe",
)
LEVELS: tuple[str, ...] = ("nominal", "hard")
STEP_S = 0.005
HEADINGS = {"right": 0.0, "down": 90.0, "left": 180.0, "up": 270.0}  # degrees, y down


@dataclass(frozen=True, slots=True)
class Pad:
    """One patch of skin (or thing) that presses: points with weights that travel together."""

    t: Array  # (K,) s since the gesture's onset
    x: Array  # (K,) taxels
    y: Array  # (K,) taxels, downward
    force: Array  # (K,) 1 = this person's usual press
    points: Array  # (P, 2) taxels, relative to x and y
    weights: Array  # (P,) sum 1
    half: float  # taxels, half the side of the little square that each point loads


@dataclass(frozen=True, slots=True)
class Performance:
    """What one person did: pads, or an electrical disturbance if `burst` is not empty."""

    kind: str
    pads: tuple[Pad, ...]
    duration: float  # s, first to last moment of contact
    burst: tuple[tuple[float, float, str], ...] = ()  # (start s, length s, "all" | "row" | "column")


@dataclass(frozen=True, slots=True)
class Person:
    """The traits of one hand, the same in all that it does."""

    sloppy: float  # 1 = a careful person, 2 = a hasty one
    press: float  # usual force
    width: float  # taxels, half the width of the fingertip's contact
    long: float  # length over width of the contact
    lean: float  # degrees, how the hand stands to the sheet
    haste: float  # factor on durations
    light: bool  # touches may be very light


def draw_person(rng: Rng, level: str) -> Person:
    """A new person; the hard ones are hastier, lighter and less careful."""
    hard = level == "hard"
    return Person(
        sloppy=float(rng.uniform(1.2, 2.2) if hard else rng.uniform(0.5, 1.2)),
        press=float(rng.uniform(0.65, 1.25) if hard else rng.uniform(0.8, 1.25)),
        width=float(rng.uniform(0.35, 0.9) if hard else rng.uniform(0.42, 0.75)),
        long=float(rng.uniform(1.0, 1.7)),
        lean=float(rng.normal(0.0, 6.0 if hard else 3.0)),
        haste=float(np.exp(rng.normal(0.0, 0.25 if hard else 0.12))),
        light=hard,
    )


def _between(rng: Rng, low: float, high: float, median: float, sigma: float) -> float:
    """A lognormal duration, clipped (s)."""
    return float(np.clip(median * np.exp(rng.normal(0.0, sigma)), low, high))


def fingertip(rng: Rng, person: Person, count: int = 19) -> tuple[Array, Array]:
    """Points of a fingertip: a sunflower in a leaning ellipse, pressed most in the middle."""
    k = np.arange(count) + 0.5
    r, a = np.sqrt(k / count), k * 2.399963
    width = person.width * rng.uniform(0.9, 1.1)
    u, v = width * r * np.cos(a), width * person.long * r * np.sin(a)
    turn = np.radians(person.lean + rng.normal(0.0, 15.0))
    points = np.stack([u * np.cos(turn) - v * np.sin(turn), u * np.sin(turn) + v * np.cos(turn)], axis=1)
    weights = np.sqrt(1.02 - r**2) * rng.uniform(0.85, 1.15, count)
    return points, weights / weights.sum()


def spline(control: Array) -> Array:
    """A Catmull-Rom curve through the control points (N, 2), 24 steps a piece, even in arc length."""
    ends = np.concatenate([2 * control[:1] - control[1:2], control, 2 * control[-1:] - control[-2:-1]])
    u = np.linspace(0.0, 1.0, 24, endpoint=False)[:, None]
    pieces = []
    for p0, p1, p2, p3 in zip(ends[:-3], ends[1:-2], ends[2:-1], ends[3:], strict=True):
        pieces.append(p1 + 0.5 * u * (p2 - p0 + u * (2 * p0 - 5 * p1 + 4 * p2 - p3 + u * (3 * (p1 - p2) + p3 - p0))))
    return np.concatenate([*pieces, control[-1:]])


def _corners(control: Array, round_off: float) -> Array:
    """A polyline (N, 2) with its corners cut, for strokes that have corners: check marks and zigzags."""
    points = [control[0]]
    for a, b, c in zip(control[:-2], control[1:-1], control[2:], strict=True):
        points += [b + (a - b) * round_off, b * 0.8 + 0.1 * (a + c) if round_off > 0.2 else b]
        points += [b + (c - b) * round_off]
    points.append(control[-1])
    return np.asarray(points)


def ramp(u: Array) -> Array:
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(u, 0.0, 1.0))


def _force(rng: Rng, person: Person, t: Array, duration: float, attack: float, decay: float) -> Array:
    """(K,) force of a press: a rise, a wavering plateau and a fall, 0 at both ends."""
    level = person.press * float(np.exp(rng.normal(0.0, 0.2 if person.light else 0.1)))
    level = max(level, 0.55 if person.light else 0.7)
    attack, decay = min(attack, duration * 0.45), min(decay, duration * 0.45)
    waver = np.interp(t, np.linspace(0, duration, 6), 1 + rng.normal(0, 0.08 * person.sloppy, 6))
    return level * ramp(t / attack) * ramp((duration - t) / decay) * np.clip(waver, 0.5, 1.6)


def _walk(rng: Rng, path: Array, t: Array, begin: float, end: float, power: float = 0.0) -> tuple[Array, Array]:
    """Run along a path from `begin` to `end` (s) with a trapezoid speed that wavers."""
    step = np.hypot(*np.diff(path, axis=0).T)
    arc = np.concatenate([[0.0], np.cumsum(step)])
    u = np.linspace(0.0, 1.0, 64)
    up, down = rng.uniform(0.1, 0.45), rng.uniform(0.1, 0.45)
    speed = np.minimum(np.minimum(u / up, (1 - u) / down), 1.0) + 0.04
    speed *= np.interp(u, np.linspace(0, 1, 7), np.exp(rng.normal(0, 0.15 + power, 7)))
    way = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)])
    s = np.interp((t - begin) / (end - begin), u, way / way[-1]) * arc[-1]
    return np.interp(s, arc, path[:, 0]), np.interp(s, arc, path[:, 1])


def _place(rng: Rng, path: Array, over: float) -> Array:
    """Shift a path to a random place where it fits on the sheet; `over` taxels may hang over."""
    low, high = path.min(axis=0), path.max(axis=0)
    room_low, room_high = -over - low, 8 + over - high
    middle = (room_low + room_high) / 2
    half = np.maximum((room_high - room_low) / 2, 0.0)
    return path + middle + half * rng.uniform(-1.0, 1.0, 2) * 0.9


def stroke(rng: Rng, person: Person, path: Array, move: float, *, rest: float = 0.0, power: float = 0.0) -> Pad:
    """One finger along one path: lands, perhaps waits, moves, perhaps rests, lifts (often while moving)."""
    wait = float(rng.uniform(0.0, 0.06))
    lift = float(rng.uniform(0.02, 0.08))
    duration = wait + move + rest + 0.02
    t = np.arange(0.0, duration + STEP_S, STEP_S)
    x, y = _walk(rng, path, t, wait, wait + move, power)
    points, weights = fingertip(rng, person)
    force = _force(rng, person, t, duration, float(rng.uniform(0.02, 0.06)), lift)
    return Pad(t, x, y, force, points, weights, 0.3)


def _performed(kind: str, pads: Sequence[Pad]) -> Performance:
    return Performance(kind, tuple(pads), max(float(p.t[-1]) for p in pads))


def _delayed(pad: Pad, by: float) -> Pad:
    return Pad(pad.t + by, pad.x, pad.y, pad.force, pad.points, pad.weights, pad.half)


def press(rng: Rng, person: Person, at: Array, duration: float, slide: float) -> Pad:
    """A press in one place, with a little slide (taxels)."""
    t = np.arange(0.0, duration + STEP_S, STEP_S)
    drift = rng.normal(0.0, slide, 2)
    points, weights = fingertip(rng, person)
    force = _force(rng, person, t, duration, float(rng.uniform(0.02, 0.08)), float(rng.uniform(0.03, 0.1)))
    u = t / duration
    return Pad(t, at[0] + drift[0] * u, at[1] + drift[1] * u, force, points, weights, 0.3)


def _spot(rng: Rng, margin: float = 0.3) -> Array:
    return rng.uniform(margin, 8 - margin, 2)


def _line(rng: Rng, person: Person, heading: float, tilt_limit: float, length: float) -> Array:
    """A hand-drawn line along `heading` (degrees), through five shaken control points."""
    tilt = np.clip(person.lean + rng.normal(0.0, 5.0 * person.sloppy), -tilt_limit, tilt_limit)
    bow = rng.normal(0.0, 0.035 * person.sloppy) * length
    u = np.linspace(0.0, 1.0, 5)
    along = u * length
    across = bow * 4 * u * (1 - u) + rng.normal(0.0, 0.05 * person.sloppy, 5)
    a = np.radians(heading + tilt)
    return np.stack([along * np.cos(a) - across * np.sin(a), along * np.sin(a) + across * np.cos(a)], axis=1)


def _swipe_time(rng: Rng, person: Person) -> tuple[float, float]:
    """How long a swipe moves and how long the finger rests at its end (s)."""
    move = _between(rng, 0.15, 1.5, 0.42 * person.haste, 0.5)
    rest = float(rng.uniform(0.05, 0.5)) if rng.random() < 0.35 else 0.0
    return move, rest


def _swipe(rng: Rng, person: Person, kind: str, heading: float, tilt_limit: float = 18.0) -> Performance:
    move, rest = _swipe_time(rng, person)
    length = float(rng.uniform(3.0, 8.0) if person.light else rng.uniform(4.0, 8.0))
    path = _place(rng, spline(_line(rng, person, heading, tilt_limit, length)), 0.4)
    return _performed(kind, [stroke(rng, person, path, move, rest=rest)])


def _two_fingers(rng: Rng, person: Person, kind: str, heading: float) -> Performance:
    move, rest = _swipe_time(rng, person)
    length = float(rng.uniform(3.0, 7.0) if person.light else rng.uniform(3.5, 7.0))
    path = spline(_line(rng, person, heading, 16.0, length))
    space = float(rng.uniform(1.5, 4.0))
    # Two fingers of one hand move side by side, nearly at right angles to the way, one a little ahead.
    side = np.radians(heading + 90.0 + rng.normal(0.0, 12.0))
    # Fingers of one hand come a little nearer or spread a little on the way.
    grow = np.interp(np.arange(len(path)), [0, len(path) - 1], [1.0, rng.uniform(0.85, 1.15)])
    offset = space * grow[:, None] * np.array([np.cos(side), np.sin(side)])
    both = _place(rng, np.concatenate([path, path + offset]), 0.4)
    first, second = both[: len(path)], both[len(path) :]
    seed = int(rng.integers(2**32))
    a = stroke(np.random.default_rng(seed), person, first, move, rest=rest)
    b = stroke(np.random.default_rng(seed), person, second, move, rest=rest)  # one hand: the same timing
    b = Pad(b.t, b.x, b.y, b.force * rng.uniform(0.65, 1.35), b.points, b.weights, b.half)
    late = float(np.abs(rng.normal(0.0, 0.03 if person.light else 0.015)))
    return _performed(kind, [_delayed(a, 0.0), _delayed(b, min(late, 0.08))])


def _circle(rng: Rng, person: Person, kind: str, turn: int) -> Performance:
    sweep = rng.uniform(300.0, 420.0)
    radius = float(rng.uniform(1.3, 3.4) if person.light else rng.uniform(1.7, 3.4))
    number = 13
    angle = np.radians(rng.uniform(0.0, 360.0) + turn * np.linspace(0.0, sweep, number))
    r = radius * (1 + rng.normal(0, 0.03 * person.sloppy, number)) * np.linspace(1, rng.uniform(0.85, 1.15), number)
    flat = rng.uniform(0.8, 1.0)
    a = rng.uniform(0.0, np.pi)
    u, v = r * np.cos(angle - a), flat * r * np.sin(angle - a)
    path = np.stack([u * np.cos(a) - v * np.sin(a), u * np.sin(a) + v * np.cos(a)], axis=1)
    path = _place(rng, spline(path), 0.3)
    move = _between(rng, 0.6, 3.0, 1.15 * person.haste, 0.35)
    rest = float(rng.uniform(0.05, 0.3)) if rng.random() < 0.2 else 0.0
    return _performed(kind, [stroke(rng, person, path, move, rest=rest, power=0.05)])


def _one_tap(rng: Rng, person: Person) -> Performance:
    duration = _between(rng, 0.05 if person.light else 0.08, 0.3, 0.14, 0.4)
    return _performed("one_tap", [press(rng, person, _spot(rng), duration, 0.08 * person.sloppy)])


def _double_tap(rng: Rng, person: Person) -> Performance:
    at = _spot(rng)
    first = press(rng, person, at, _between(rng, 0.06, 0.25, 0.11, 0.3), 0.05)
    gap = _between(rng, 0.1, 0.4, 0.19, 0.4)
    again = at + rng.normal(0.0, 0.15 * person.sloppy, 2)
    second = press(rng, person, again, _between(rng, 0.06, 0.3, 0.12, 0.3), 0.05)
    return _performed("double_tap", [first, _delayed(second, float(first.t[-1]) + gap)])


def _long_press(rng: Rng, person: Person) -> Performance:
    return _performed("long_press", [press(rng, person, _spot(rng), float(rng.uniform(0.9, 3.5)), 0.15)])


def _palm(rng: Rng, person: Person) -> Performance:
    """The heel of a hand: two bulges, sometimes with finger pads above them."""
    duration = float(rng.uniform(0.3, 1.8))
    t = np.arange(0.0, duration + STEP_S, STEP_S)
    centre = rng.uniform(2.5, 5.5, 2)
    a = rng.uniform(0.0, np.pi)
    bulges = []
    for side in (-1.0, 1.0):
        spot = side * rng.uniform(0.8, 1.8) * np.array([np.cos(a), np.sin(a)])
        bulges.append(spot + rng.normal(0.0, rng.uniform(0.5, 1.0), (28, 2)))
    points = np.concatenate(bulges)
    weights = rng.uniform(0.3, 1.0, len(points))
    roll = rng.normal(0.0, 0.5, 2)
    force = _force(rng, person, t, duration, 0.12, 0.15) * rng.uniform(3.0, 6.0)
    u = t / duration
    pads = [Pad(t, centre[0] + roll[0] * u, centre[1] + roll[1] * u, force, points, weights / weights.sum(), 0.45)]
    for _ in range(int(rng.integers(0, 4))):
        at = centre + rng.uniform(2.0, 4.0) * np.array([np.cos(c := rng.uniform(0, 2 * np.pi)), np.sin(c)])
        pad = press(rng, person, at, duration * rng.uniform(0.5, 0.85), 0.2)
        pads.append(_delayed(pad, duration * 0.08))
    return _performed("palm", pads)


def _scribble(rng: Rng, person: Person) -> Performance:
    number = int(rng.integers(6, 11))
    control = [_spot(rng)]
    while len(control) < number:
        new = _spot(rng)
        if np.hypot(*(new - control[-1])) > 2.5:
            control.append(new)
    path = spline(np.asarray(control))
    move = float(rng.uniform(0.22, 0.4)) * number
    return _performed("scribble", [stroke(rng, person, path, move, power=0.15)])


def _zigzag(rng: Rng, person: Person) -> Performance:
    legs = int(rng.integers(3, 6))
    across, along = rng.uniform(2.5, 6.0), rng.uniform(3.0, 7.0)
    k = np.arange(legs + 1)
    points = np.stack([along * k / legs, across * (k % 2)], axis=1) + rng.normal(0, 0.2, (legs + 1, 2))
    a = rng.choice([0.0, 90.0, 180.0, 270.0]) + rng.normal(0.0, 10.0)
    a = np.radians(a)
    points = points @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
    path = _place(rng, _corners(points, float(rng.uniform(0.05, 0.3))), 0.3)
    return _performed("zigzag", [stroke(rng, person, path, float(rng.uniform(0.16, 0.4)) * legs)])


def _check_mark(rng: Rng, person: Person) -> Performance:
    short = rng.uniform(1.8, 3.0)
    long = short * rng.uniform(1.6, 2.4)
    down, up = np.radians(rng.uniform(40, 65)), np.radians(-rng.uniform(40, 65))
    low = short * np.array([np.cos(down), np.sin(down)])
    points = np.stack([np.zeros(2), low, low + long * np.array([np.cos(up), np.sin(up)])])
    path = _place(rng, _corners(points, 0.08), 0.3)
    return _performed("check_mark", [stroke(rng, person, path, float(rng.uniform(0.4, 1.1)))])


def _pinch(rng: Rng, person: Person) -> Performance:
    """Thumb and finger come together, or spread."""
    centre = rng.uniform(2.5, 5.5, 2)
    a = rng.uniform(0.0, np.pi)
    way = np.array([np.cos(a), np.sin(a)])
    wide, near = rng.uniform(4.5, 7.0) / 2, rng.uniform(1.2, 2.0) / 2
    begin, end = (wide, near) if rng.random() < 0.6 else (near, wide)
    move = float(rng.uniform(0.25, 1.0))
    pads = []
    for side in (-1.0, 1.0):
        ends = centre + side * way * np.array([[begin], [end]])
        middle = ends.mean(axis=0) + rng.normal(0.0, 0.2, 2)
        pads.append(stroke(rng, person, spline(np.stack([ends[0], middle, ends[1]])), move))
    return _performed("pinch", [pads[0], _delayed(pads[1], float(rng.uniform(0.0, 0.04)))])


def _two_finger_tap(rng: Rng, person: Person) -> Performance:
    duration = _between(rng, 0.08, 0.35, 0.16, 0.35)
    a = rng.normal(0.0, 0.4)
    space = rng.uniform(1.8, 4.0) * np.array([np.cos(a), np.sin(a)])
    both = _place(rng, np.stack([np.zeros(2), space]), -0.3)
    pads = [press(rng, person, spot, duration * rng.uniform(0.9, 1.1), 0.08) for spot in both]
    return _performed("two_finger_tap", [pads[0], _delayed(pads[1], float(rng.uniform(0.0, 0.03)))])


def _object(rng: Rng, person: Person) -> Performance:
    """A thing put down: a phone's edge, a cup's ring or a box; it lies still, with an uneven weight."""
    duration = float(rng.uniform(1.5, 5.0))
    t = np.arange(0.0, duration + STEP_S, STEP_S)
    centre = rng.uniform(2.0, 6.0, 2)
    if rng.random() < 0.5:
        a = np.arange(40) * 2 * np.pi / 40
        points = rng.uniform(1.2, 3.0) * np.stack([np.cos(a), np.sin(a)], axis=1)
    else:
        size = rng.uniform(1.5, 6.0, 2)
        points = (rng.random((48, 2)) - 0.5) * size
    heavy = rng.normal(0.0, 0.25, 2)
    weights = np.clip(1 + points @ heavy, 0.15, None) * rng.uniform(0.6, 1.4, len(points))
    force = rng.uniform(2.0, 6.0) * ramp(t / rng.uniform(0.05, 0.2)) * ramp((duration - t) / 0.08)
    still = np.full(len(t), 1.0)
    return _performed(
        "object", [Pad(t, centre[0] * still, centre[1] * still, force, points, weights / weights.sum(), 0.35)]
    )


def _sleeve(rng: Rng, person: Person) -> Performance:
    """Cloth that brushes over: folds that are wide and light, come and go, and travel together."""
    move = float(rng.uniform(0.3, 1.5))
    t = np.arange(0.0, move + STEP_S, STEP_S)
    a = rng.uniform(0.0, 2 * np.pi)
    way, side = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
    travel = rng.uniform(4.0, 9.0)
    pads = []
    for _ in range(int(rng.integers(3, 7))):
        start = 4.0 + way * (rng.uniform(-1.2, 1.2) - travel / 2) + side * rng.uniform(-3.5, 3.5)
        points = np.outer(rng.uniform(-1.6, 1.6, 16), side) + np.outer(rng.normal(0, 0.4, 16), way)
        waver = np.clip(np.interp(t, np.linspace(0, move, 8), rng.normal(0.35, 0.35, 8)), 0.0, None)
        waver[(t < 0.02) | (t > move - 0.02)] = 0.0
        s = np.interp(t, np.linspace(0, move, 6), np.sort(np.r_[0, rng.random(4), 1])) * travel
        place = start + s[:, None] * way
        pads.append(Pad(t, place[:, 0], place[:, 1], person.press * waver * 1.6, points, np.full(16, 1 / 16), 0.4))
    return _performed("sleeve", pads)


def _burst(rng: Rng, person: Person) -> Performance:
    """Electricity, not touch: a switch, a telephone, a static discharge."""
    bursts, t = [], 0.0
    for _ in range(int(rng.integers(1, 5))):
        length = float(rng.uniform(0.03, 0.25))
        bursts.append((t, length, str(rng.choice(["all", "row", "column"]))))
        t += length + float(rng.uniform(0.0, 0.3))
    return Performance("burst", (), bursts[-1][0] + bursts[-1][1], tuple(bursts))


_OTHERS: dict[str, Callable[[Rng, Person], Performance]] = {
    "one_tap": _one_tap,
    "double_tap": _double_tap,
    "long_press": _long_press,
    "palm": _palm,
    "scribble": _scribble,
    "zigzag": _zigzag,
    "pinch": _pinch,
    "two_finger_tap": _two_finger_tap,
    "object": _object,
    "sleeve": _sleeve,
    "burst": _burst,
    "check_mark": _check_mark,
}


def perform(kind: str, rng: Rng, person: Person) -> Performance:
    """Let one person perform a gesture or non-gesture. Raises KeyError for an unknown kind."""
    if kind == "two_finger_sideways":
        return _two_fingers(rng, person, kind, HEADINGS[str(rng.choice(["left", "right"]))])
    if kind == "diagonal_swipe":
        upright = Person(person.sloppy, person.press, person.width, person.long, 0.0, person.haste, person.light)
        return _swipe(rng, upright, kind, float(rng.choice([45.0, 135.0, 225.0, 315.0])), 11.0)
    if kind.endswith("_two_fingers"):
        return _two_fingers(rng, person, kind, HEADINGS[kind.split("_")[1]])
    if kind.startswith("swipe_"):
        return _swipe(rng, person, kind, HEADINGS[kind.removeprefix("swipe_")])
    if kind.startswith("circle_"):
        return _circle(rng, person, kind, 1 if kind == "circle_clockwise" else -1)
    return _OTHERS[kind](rng, person)
