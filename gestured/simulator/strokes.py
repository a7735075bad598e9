"""Building blocks of performances: a finger that stays, a stroke, and several fingers on one stroke."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from gestured.simulator.kinematics import Array, arc, grid, stroke_progress, wander
from gestured.simulator.occasion import Occasion
from gestured.simulator.people import Press


def touch_down(
    occasion: Occasion, x: float, y: float, duration_s: float, start: float = 0.0, force: float = 1.0
) -> Press:
    """A finger that stays where it lands for `duration_s`, and rolls a little."""
    rng = occasion.rng
    t = grid(duration_s)
    # A fingertip rolls on and off, and its centre moves with the load: some millimetres on a real panel.
    u = t / duration_s
    roll = np.multiply.outer(u - 0.5, np.clip(rng.normal(0.0, 1.9, 2), -4.5, 4.5))
    roll += np.multiply.outer(np.sin(math.pi * u), rng.normal(0.0, 0.8, 2))
    x_then, y_then, edge = x + roll[:, 0], y + roll[:, 1], 0.5 * duration_s
    come, go = min(rng.uniform(0.015, 0.09), edge), min(rng.uniform(0.02, 0.11), edge)
    return occasion.finger(t, x_then, y_then, force=force, start=start, fade_in_s=come, fade_out_s=go)


@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """A path relative to its centre (mm, s), and how long the finger takes to land on it and to leave it."""

    t: Array
    x: Array
    y: Array
    fade_in_s: float
    fade_out_s: float


def stroke(occasion: Occasion, heading: float, length: float, *, limit: float = 0.36) -> Stroke:
    """One stroke of `length` millimetres towards `heading` (radians), at most `limit` radians off.

    It is bent about wrist or elbow and unsteady, and sometimes has a hook at the end, rests, or moving ends. Its
    duration grows with length^0.4, as in free reaching.
    """
    rng, person = occasion.rng, occasion.person
    error = float(np.clip(occasion.turn + rng.normal(0.0, person.aim), -limit, limit))
    bend = float(np.clip(person.bend * length * rng.uniform(0.3, 1.6) + rng.normal(0.0, 0.06), -0.85, 0.85))
    move = float(np.clip(0.42 * (length / 50.0) ** 0.4 / occasion.rate * rng.lognormal(0.0, 0.15), 0.13, 1.6))
    before, after = occasion.rests()
    glides = before == 0.0 and after == 0.0 and rng.random() < 0.2 + 0.7 * person.glide
    t = grid(before + move + after)
    tau = (t - before) / move
    s = stroke_progress(tau, rng, moving_ends=float(rng.uniform(0.2, 1.0)) if glides else 0.0)
    x, y = arc(s, length, heading + error, bend)
    if rng.random() < 0.15:
        # A hook: the finger turns away or springs back as it stops.
        hook = rng.uniform(0.03, 0.11) * length
        away = heading + error + rng.choice([0.5, -0.5, 0.8, -0.8, 1.0]) * math.pi
        late = 0.5 + 0.5 * np.tanh((tau - 0.93) / 0.05)
        x, y = x + hook * late * math.cos(away), y + hook * late * math.sin(away)
    sway = person.wobble_mm * wander(t, rng, 0.4, 3.0, 3) * min(1.0, length / 30.0)
    x, y = x - sway * math.sin(heading), y + sway * math.cos(heading)
    half = 0.5 * length
    # With full fades, a flick would leave nothing between two frames.
    soft = min(1.0, move / 0.3)
    fade_in = soft * rng.uniform(0.05, 0.35) * move if glides else rng.uniform(0.02, 0.08)
    fade_out = soft * rng.uniform(0.05, 0.4) * move if glides else rng.uniform(0.02, 0.1)
    return Stroke(t, x - half * math.cos(heading), y - half * math.sin(heading), float(fade_in), float(fade_out))


def swipe_length(occasion: Occasion, heading: float) -> float:
    """The length of a swipe in mm: 0.2 to 0.97 of the pad's extent in that direction, and 12 to 150."""
    across = abs(math.cos(heading)) * occasion.width + abs(math.sin(heading)) * occasion.height
    across = min(across, 1.25 * occasion.small / max(abs(math.cos(heading)), abs(math.sin(heading)), 0.7) + 60.0)
    length = across * (0.21 + 0.72 * occasion.reach()) * occasion.grow
    return float(np.clip(length, max(12.0, 0.2 * across), min(150.0, 0.97 * across)))


def fingers_on(occasion: Occasion, path: Stroke, count: int, heading: float) -> list[Press]:
    """One finger on a stroke, or several side by side, uneven in force, size, length, landing and lifting."""
    rng, finger = occasion.rng, partial(occasion.finger, fade_in_s=path.fade_in_s, fade_out_s=path.fade_out_s)
    if count == 1:
        return [finger(path.t, *occasion.settle(path.x, path.y))]
    gap = min(occasion.spacing(), 0.8 * occasion.small / (count - 1))
    side = heading + math.pi / 2 + float(np.clip(rng.normal(0.0, 0.25), -0.6, 0.6))
    offsets = (np.arange(count) - (count - 1) / 2) * gap * rng.uniform(0.9, 1.1, count)
    xs = [path.x * rng.uniform(0.9, 1.08) + o * math.cos(side) for o in offsets]
    ys = [path.y * rng.uniform(0.9, 1.08) + o * math.sin(side) for o in offsets]
    xs, ys = (np.split(moved, count) for moved in occasion.settle(np.concatenate(xs), np.concatenate(ys)))
    total = float(path.t[-1])
    delay_s = min(0.08, 0.25 * total)
    forces = rng.uniform(0.35, 1.0, count) if rng.random() < 0.3 else rng.uniform(0.7, 1.0, count)
    forces /= forces.max()
    contacts = []
    for k in range(count):
        first = rng.uniform(0.0, delay_s) if k else 0.0
        last = rng.uniform(0.0, delay_s)
        t = grid(total - first - last)
        x, y = (np.interp(t + first, path.t, way[k]) for way in (xs, ys))
        size = float(rng.uniform(0.85, 1.12))
        contacts.append(finger(t, x, y, force=float(forces[k]), size=size, start=first))
    return contacts
