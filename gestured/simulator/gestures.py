"""The ten gestures: for each a function from an occasion to the contacts that a person makes."""

import math
from collections.abc import Callable

import numpy as np

from gestured.simulator.kinematics import ellipse, grid, turning, wander
from gestured.simulator.occasion import Occasion
from gestured.simulator.people import Press
from gestured.simulator.strokes import fingers_on, stroke, swipe_length, touch_down
from gestured.simulator.things import resting_hand

RIGHT, UP, LEFT, DOWN = 0.0, math.pi / 2, math.pi, -math.pi / 2


def one_tap(occasion: Occasion) -> list[Press]:
    """One finger for 40 to 450 ms, anywhere."""
    x, y = occasion.spot(3.0, 3.0)
    return [touch_down(occasion, x, y, occasion.tap_s())]


def double_tap(occasion: Occasion) -> list[Press]:
    """Two taps 80 to 420 ms apart at about the same place, unequal in force and duration."""
    rng = occasion.rng
    x, y = occasion.spot(3.0, 3.0)
    first, gap = occasion.tap_s(), occasion.gap_s()
    dx, dy = np.clip(rng.normal(0.0, 0.03, 2), -0.09, 0.09) * occasion.small
    return [
        touch_down(occasion, x, y, first, force=rng.uniform(0.7, 1.2)),
        touch_down(occasion, x + dx, y + dy, occasion.tap_s(), first + gap, force=rng.uniform(0.7, 1.2)),
    ]


def swipe(heading: float, count: int = 1) -> Callable[[Occasion], list[Press]]:
    """A maker of strokes towards `heading` (radians) with `count` fingers side by side."""

    def performed(occasion: Occasion) -> list[Press]:
        # Several fingers side by side keep their direction better than one.
        path = stroke(occasion, heading, swipe_length(occasion, heading), limit=0.36 if count == 1 else 0.3)
        contacts = fingers_on(occasion, path, count, heading)
        if count == 1 and occasion.rng.random() < 0.25 * occasion.person.clumsy:
            contacts.append(resting_hand(occasion, float(path.t[-1])))
        return contacts

    return performed


def circle(sense: float) -> Callable[[Occasion], list[Press]]:
    """A maker of circles of 270 to 450 degrees; `sense` is 1 for counter-clockwise and -1 for clockwise."""

    def performed(occasion: Occasion) -> list[Press]:
        rng, person = occasion.rng, occasion.person
        radius = float(np.clip(occasion.small * (0.1 + 0.31 * occasion.reach()) * occasion.grow, 6.0, 60.0))
        total = math.radians(rng.uniform(300.0, 400.0) if rng.random() < 0.75 else rng.uniform(270.0, 450.0))
        move = float(np.clip(0.95 * (radius / 18.0) ** 0.3 / occasion.rate * rng.lognormal(0.0, 0.2), 0.45, 3.2))
        before, after = (0.6 * rest for rest in occasion.rests())
        t = grid(before + move + after)
        tau = np.clip((t - before) / move, 0.0, 1.0)
        first = rng.normal(math.pi / 2, 0.9) if rng.random() < 0.55 else rng.uniform(-math.pi, math.pi)
        phase = first + sense * total * turning(tau, rng)
        # A real circle does not close, and is somewhat like an egg or a rounded triangle.
        egg = rng.uniform(0.0, 0.09) * np.cos(int(rng.integers(2, 4)) * phase + rng.uniform(0.0, 6.3))
        size = radius * (1.0 + rng.normal(0.0, 0.12) * (tau - 0.5) * 2.0 + egg)
        x, y = ellipse(phase, size, rng.uniform(1.0, 1.6), rng.uniform(0.0, math.pi))
        drift = rng.normal(0.0, 0.13, 2) * radius
        sway = 0.6 * person.wobble_mm * min(1.0, radius / 15.0)
        x = x + drift[0] * tau + sway * wander(t, rng, 0.4, 3.0, 3)
        y = y + drift[1] * tau + sway * wander(t, rng, 0.4, 3.0, 3)
        x, y = occasion.settle(x, y)
        glides = before == 0.0 and rng.random() < person.glide
        fade = rng.uniform(0.03, 0.12) * move if glides else None
        contacts = [occasion.finger(t, x, y, fade_in_s=fade, fade_out_s=fade)]
        if rng.random() < 0.2 * person.clumsy:
            contacts.append(resting_hand(occasion, float(t[-1])))
        return contacts

    return performed


TEN: dict[str, Callable[[Occasion], list[Press]]] = {
    "one_tap": one_tap,
    "double_tap": double_tap,
    "swipe_down": swipe(DOWN),
    "swipe_up": swipe(UP),
    "swipe_right": swipe(RIGHT),
    "swipe_left": swipe(LEFT),
    "circle_clockwise": circle(-1.0),
    "circle_counter_clockwise": circle(1.0),
    "swipe_up_two_fingers": swipe(UP, 2),
    "swipe_down_two_fingers": swipe(DOWN, 2),
}
