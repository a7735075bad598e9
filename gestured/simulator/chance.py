"""Everyday life by chance: patches of any size on any way with any course of force, for a moment or for a while.

`places` draws things that its author thought of, and a model that learns from them knows these drawings better than the
things. Here no thing is drawn: each number of a contact comes from the widest range that a body or a thing can cause on
a pad, independent of the other numbers. Contacts that would be gestures are left out: one or two narrow patches stay
for longer than a tap, and go no further than a tap does.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gestured.simulator.kinematics import Array, grid, wander
from gestured.simulator.occasion import Occasion
from gestured.simulator.people import Press
from gestured.simulator.places import PLACES, Place
from gestured.simulator.resting import NOBODY, STEP_S
from gestured.simulator.unmeant import Places, even

NARROW_MM = 6.5  # a patch that is not longer may be a finger
MOMENTS = {"armrest": 150.0, "door": 150.0, "seat": 120.0, "skin": 170.0, "table": 150.0}  # an hour; assumed
LIES_S = 25.0  # median dwell time; assumed


def _size(occasion: Occasion, low: float, high: float) -> tuple[float, float]:
    """Length and width of a patch (mm, one standard deviation)."""
    length = even(occasion, low, high)
    return length, length * even(occasion, 0.3, 1.0)


def _course(occasion: Occasion, t: Array) -> Array:
    """The force (n,), 0 at both ends: any rise and fall, a tilted plateau, unrest, stick and slip."""
    rng, total = occasion.rng, float(t[-1])
    up, down = (float(rng.uniform(0.02, 0.9)) * total for _ in range(2))
    up, down = (max(share * min(1.0, total / (up + down)), 0.01) for share in (up, down))
    rise = np.clip(t / up, 0.0, 1.0) ** even(occasion, 0.4, 2.5)
    level = rise * np.clip((total - t) / down, 0.0, 1.0) ** even(occasion, 0.4, 2.5)
    level = level * (1.0 + float(rng.uniform(-0.9, 0.9)) * (t / total - 0.5))
    if rng.random() < 0.6:
        depth = float(rng.uniform(0.05, 0.9))
        level = level * np.clip(1.0 + depth * wander(t, rng, 0.3, even(occasion, 1.0, 8.0)), 0.0, 3.0)
    if rng.random() < 0.25:
        swing = np.sin(2.0 * math.pi * (even(occasion, 1.0, 7.0) * t + rng.random()))
        level = level * (swing > float(rng.uniform(-1.0, 0.3)))
    return np.asarray(np.maximum(level, 0.0))


def _way(occasion: Occasion, t: Array, small: float) -> tuple[Array, Array]:
    """x, y (n,) in mm from the place of landing: a contact stays, passes, bends, goes to and fro, or wanders."""
    rng, u = occasion.rng, t / t[-1]
    heading, kind = float(rng.uniform(-math.pi, math.pi)), int(rng.integers(6))
    reach = small * even(occasion, 0.02, 1.6)
    if kind == 0:
        reach = small * even(occasion, 0.005, 0.08)
    done = u ** even(occasion, 0.4, 2.5)
    if kind in (0, 1):
        along, aside = reach * done, np.zeros_like(u)
    elif kind == 2:
        bend = float(rng.uniform(-3.0, 3.0))
        tight = abs(bend) + 0.1
        along, aside = reach * np.sin(bend * done) / tight, reach * (1.0 - np.cos(bend * done)) / tight
    elif kind == 3:
        turns = even(occasion, 0.4, 3.0) * max(1.0, float(t[-1]))
        along = 0.5 * reach * np.sin(2.0 * math.pi * turns * done)
        aside = 0.1 * reach * wander(t, rng, 0.3, 2.0)
    else:
        pace = even(occasion, 0.2, 3.0)
        along, aside = (0.3 * reach * wander(t, rng, 0.3 * pace, 1.5 * pace) for _ in range(2))
    c, s = math.cos(heading), math.sin(heading)
    return along * c - aside * s, along * s + aside * c


def anything(occasion: Occasion) -> list[Press]:
    """One to five patches, which move together or each by itself, once to four times."""
    rng, small = occasion.rng, occasion.small
    count = int(rng.choice([1, 2, 3, 4, 5], p=[0.5, 0.2, 0.15, 0.1, 0.05]))
    sizes = [_size(occasion, 2.5, 32.0) for _ in range(count)]
    narrow = count <= 2 and all(length < NARROW_MM for length, _ in sizes)
    length = even(occasion, 0.5, 5.0) if narrow else even(occasion, 0.05, 4.0)
    force, again = even(occasion, 0.08, 8.0), int(rng.choice([1, 2, 3, 4], p=[0.6, 0.2, 0.12, 0.08]))
    cx, cy = occasion.spot(2.0, 2.0, beyond=0.3)
    spread, lag = even(occasion, 4.0, 0.6 * small), float(rng.uniform(0.0, 0.3)) * length
    places = [(0.0, 0.0), *((float(rng.normal(0.0, spread)), float(rng.normal(0.0, spread))) for _ in range(count - 1))]
    together, flatness = rng.random() < 0.5, even(occasion, 0.85, 3.5)
    reach, made, start = 0.12 * small if narrow else small, [], 0.0
    for _ in range(again):
        t = grid(max(length * even(occasion, 0.7, 1.4), 0.04))
        (dx, dy), course = _way(occasion, t, reach), _course(occasion, t)
        shift = rng.normal(0.0, 0.03, 2) * small
        for (px, py), size in zip(places, sizes, strict=True):
            if not together:
                (dx, dy), course = _way(occasion, t, reach), _course(occasion, t)
            late = float(rng.uniform(0.0, lag)) if count > 1 else 0.0
            force_here = force * even(occasion, 0.3, 1.0) * course
            x, y = cx + px + shift[0] + dx, cy + py + shift[1] + dy
            turn, growth = float(rng.uniform(0.0, math.pi)), float(rng.uniform(0.05, 0.35))
            made.append(Press(t + start + late, x, y, force_here, *size, turn, growth, flatness, False))
        start += float(t[-1]) + even(occasion, 0.06, 1.5)
    return made


def lies(occasion: Occasion, seconds: float, _: float) -> tuple[list[Press], Places]:
    """One to six patches that lie for `seconds`, with unrest, shifts and lifts or still; fingertips may play nearby."""
    rng, small = occasion.rng, occasion.small
    t = np.linspace(0.0, seconds, max(8, math.ceil(seconds / STEP_S) + 1))
    cx, cy = (float(rng.uniform(-0.15, 1.15)) * side for side in (occasion.width, occasion.height))
    spread, force, still = even(occasion, 3.0, 0.5 * small), even(occasion, 0.15, 8.0), rng.random() < 0.3
    made = []
    for _ in range(int(rng.integers(1, 7))):
        land, leave = (min(even(occasion, 0.03, 1.0), 0.4 * seconds) for _ in range(2))
        level = np.clip(t / land, 0.0, 1.0) * np.clip((seconds - t) / leave, 0.0, 1.0)
        x, y = (np.full_like(t, c + float(rng.normal(0.0, spread))) for c in (cx, cy))
        if not still:
            level = level * (1.0 + float(rng.uniform(0.0, 0.15)) * wander(t, rng, 0.1, 6.0))
            for moment in rng.uniform(0.0, seconds, int(rng.poisson(seconds / even(occasion, 5.0, 90.0)))):
                step = np.clip((t - moment) / even(occasion, 0.1, 1.0), 0.0, 1.0)
                dx, dy = (float(rng.normal(0.0, 0.05 * small)) for _ in range(2))
                x, y = x + dx * step, y + dy * step
                level = level * np.exp(float(rng.normal(0.0, 0.3)) * step)
                if rng.random() < 0.2:
                    depth, long = float(rng.uniform(0.3, 1.0)), even(occasion, 0.1, 0.6)
                    level = level * (1.0 - depth * np.exp(-(((t - moment) / long) ** 2)))
        level = force * even(occasion, 0.1, 1.0) * np.maximum(level, 0.0)
        size = _size(occasion, 3.0, 0.5 * small)
        turn, flatness = float(rng.uniform(0.0, math.pi)), even(occasion, 0.9, 3.0)
        made.append(Press(t, x, y, level, *size, turn, 0.1, flatness, False))
    if not still and rng.random() < 0.5 and seconds > 2.0:
        made += _play(occasion, seconds, cx, cy)
    return made, ()


def _play(occasion: Occasion, seconds: float, cx: float, cy: float) -> list[Press]:
    """Fingertips near (cx, cy) tap, press, slide and drum."""
    rng, reach, made = occasion.rng, 0.4 * occasion.small, []
    fingers = [(cx + float(rng.normal(0.0, reach)), cy + float(rng.normal(0.0, reach))) for _ in range(4)]
    for moment in np.sort(rng.uniform(0.0, seconds - 1.0, int(rng.poisson(seconds / even(occasion, 6.0, 90.0))))):
        at, run = float(moment), int(rng.choice([1, 2, 3, 6], p=[0.5, 0.2, 0.15, 0.15]))
        for k in range(run):
            t = grid(even(occasion, 0.05, 1.5))
            dx, dy = _way(occasion, t, even(occasion, 0.02, 0.4) * occasion.small)
            x, y = fingers[(k + run) % 4]
            press = occasion.finger(t, x + dx, y + dy, force=even(occasion, 0.15, 1.5))
            if at + float(press.t[-1]) < seconds:
                made.append(replace(press, t=press.t + at))
            at += float(t[-1]) + even(occasion, 0.03, 0.6)
    return made


def _by_chance(place: Place) -> Place:
    """The same place with contacts by chance, as much time without anybody, and as many meant gestures."""
    nobody = place.postures[NOBODY]
    return replace(
        place,
        postures={NOBODY: nobody / (sum(place.postures.values()) - nobody), "lies": 1.0},
        rates={"anything": MOMENTS[place.name]},
        rests={NOBODY: place.rests[NOBODY], "lies": (lies, LIES_S)},
        happenings={"anything": anything},
    )


CHANCE: Mapping[str, Place] = {name: _by_chance(place) for name, place in PLACES.items()}
