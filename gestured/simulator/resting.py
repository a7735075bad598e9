"""Postures that rest on a sensor for a while: arms, elbows, hands with their fingers, bodies, things.

Whatever rests lands, breathes, shifts every few seconds, lifts for a moment, is shaken by the road, and leaves. A hand
or an arm touches a sensor in several patches, which do all this together, each with a force of its own.
"""

import math
from dataclasses import dataclass

import numpy as np

from gestured.simulator.kinematics import Array, wander
from gestured.simulator.occasion import Occasion
from gestured.simulator.people import Press
from gestured.simulator.unmeant import Places, even

STEP_S = 0.04  # time grid of what rests, in which nothing is faster than the road
BREATH_HZ = 0.25  # an adult at rest
ROAD_HZ = (1.0, 12.0)  # what a body on a seat passes on of a road's spectrum, which falls with the square (ISO 8608)
RESEAT_S = 9.0  # mean time between two shifts of what rests; assumed
LIFT_S = 40.0  # mean time between two moments in which what rests is lifted, partly or wholly; assumed
BESIDE = 0.05  # of the pad's side: the middle of what rests may lie so far beyond the border; assumed


@dataclass(frozen=True)
class Posture:
    """Something that rests: how long, how heavily, and how large it is."""

    dwell_s: float  # the median of a lognormal distribution
    force: tuple[float, float]  # range, in normal touches
    size: tuple[float, float]  # of the pad's shorter side: length and width, one standard deviation
    patches: int = 1  # the most patches, which lie in a row along its length
    still: bool = False  # whether it neither breathes nor moves


NOBODY, HAND, THING = "nobody", "hand", "thing"
# Dwell times are assumed, except those of "forearm" (laid on), "elbow" (while steering) and "push_off": these are the
# three postures that were measured on door armrests (SAE 2007-01-1217).
POSTURES = {
    NOBODY: Posture(25.0, (0.0, 0.0), (0.0, 0.0)),
    "forearm": Posture(40.0, (0.5, 7.0), (0.5, 0.16), patches=3),
    "elbow": Posture(20.0, (1.0, 9.0), (0.18, 0.14)),
    "push_off": Posture(1.2, (2.0, 12.0), (0.25, 0.2), patches=2),
    HAND: Posture(18.0, (0.3, 3.0), (0.26, 0.17)),
    "body": Posture(90.0, (0.5, 4.0), (0.6, 0.45), patches=3),
    THING: Posture(60.0, (0.3, 3.0), (0.16, 0.1), patches=4, still=True),
}


def rest(name: str, occasion: Occasion, seconds: float, road: float) -> tuple[list[Press], Places]:
    """A posture's presses for `seconds`, shaken by the share `road` of its force; and where a hand's fingers lie."""
    posture, rng, small = POSTURES[name], occasion.rng, occasion.small
    t = np.linspace(0.0, seconds, max(8, math.ceil(seconds / STEP_S) + 1))
    course = _course(t, rng, posture, road)
    shift = 0.0 if posture.still else even(occasion, 0.02, 0.25) * small
    dx, dy = (shift * _reseated(t, rng) for _ in range(2))
    x, y = (side * float(rng.uniform(-BESIDE, 1.0 + BESIDE)) for side in (occasion.width, occasion.height))
    angle = float(rng.uniform(0.0, math.pi))
    level = even(occasion, *posture.force) * occasion.person.force
    length, width = (small * side * float(rng.uniform(0.6, 1.4)) for side in posture.size)
    flatness = float(rng.uniform(0.9, 3.0 if posture.still else 1.5))
    count = int(rng.integers(1, posture.patches + 1))
    made = []
    for k in range(count):
        along = 2.0 * length * (k - (count - 1) / 2) / max(count - 1, 1)
        force = level * float(rng.uniform(0.3, 1.0)) * course * np.exp(0.2 * _reseated(t, rng) * (not posture.still))
        a, b = x + along * math.cos(angle) + dx, y + along * math.sin(angle) + dy
        made.append(Press(t, a, b, force, length / count**0.5, width, angle, 0.1, flatness, False))
    if name != HAND:
        return made, ()
    # The fingers lie in a row before the palm. Some press on the pad; others lie so lightly that they leave nothing.
    fingers, reach, gap = int(rng.integers(1, 5)), float(rng.uniform(35.0, 90.0)), occasion.spacing()
    places = []
    for k in range(fingers):
        aside = gap * (k - (fingers - 1) / 2)
        fx = x + reach * math.cos(angle) - aside * math.sin(angle)
        fy = y + reach * math.sin(angle) + aside * math.cos(angle)
        places.append((fx, fy))
        if rng.random() < 0.6:
            force = level * even(occasion, 0.03, 0.5) * course * (1.0 + 0.4 * _reseated(t, rng))
            size = occasion.person.finger_mm * float(rng.uniform(0.9, 1.5))
            made.append(Press(t, fx + dx, fy + dy, force, size * 1.3, size, angle, 0.1, 1.2, False))
    return made, places


def _course(t: Array, rng: np.random.Generator, posture: Posture, road: float) -> Array:
    """The force (n,), about 1, of something that lands, breathes, lifts, is shaken by the road, and leaves."""
    seconds = float(t[-1])
    land, leave = (min(float(rng.uniform(0.05, 0.5)), 0.4 * seconds) for _ in range(2))
    course = np.clip(t / land, 0.0, 1.0) * np.clip((seconds - t) / leave, 0.0, 1.0)
    shaken = 1.0 + road * wander(t, rng, *ROAD_HZ, 8)
    if not posture.still:
        shaken += float(rng.uniform(0.01, 0.06)) * np.sin(2 * math.pi * (BREATH_HZ * t + rng.random()))
        for moment in rng.uniform(0.0, seconds, int(rng.poisson(seconds / LIFT_S))):
            depth, length = float(rng.uniform(0.3, 1.0)), float(rng.uniform(0.1, 0.6))
            shaken -= depth * np.exp(-(((t - moment) / length) ** 2))
    return np.asarray(course * np.maximum(shaken, 0.0))


def _reseated(t: Array, rng: np.random.Generator) -> Array:
    """A random course (n,) within -1..1 with a step every RESEAT_S on average, each within a third of a second."""
    moments = np.sort(rng.uniform(0.0, t[-1], int(rng.poisson(t[-1] / RESEAT_S))))
    way = np.zeros_like(t)
    for moment, step in zip(moments, rng.normal(0.0, 1.0, moments.size), strict=True):
        way += step * np.clip((t - moment) / 0.33, 0.0, 1.0)
    return np.asarray(np.tanh(way))
