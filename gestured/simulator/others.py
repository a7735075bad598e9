"""Presses, taps and strokes of one finger that are none of the ten gestures, and the table of all non-gestures."""

import math
from dataclasses import replace

from gestured.simulator.drawn import DRAWN, drawn
from gestured.simulator.gestures import DOWN, LEFT, RIGHT, UP
from gestured.simulator.kinematics import arc, grid, stroke_progress
from gestured.simulator.occasion import Maker, Occasion, named
from gestured.simulator.people import Press
from gestured.simulator.several import SEVERAL
from gestured.simulator.strokes import fingers_on, stroke, swipe_length, touch_down
from gestured.simulator.things import THINGS


def long_press(occasion: Occasion) -> list[Press]:
    """A finger that stays for 0.9 s or longer."""
    x, y = occasion.spot(3.0, 3.0)
    return [touch_down(occasion, x, y, occasion.rng.uniform(0.9, 3.0))]


def slow_touch(occasion: Occasion) -> list[Press]:
    """A light touch that comes and goes slowly and drifts a little, as of somebody who leans or feels."""
    rng = occasion.rng
    x, y = occasion.spot(3.0, 3.0)
    t = grid(rng.uniform(0.9, 2.6))
    drift = rng.normal(0.0, 2.0, 2)
    half, force = 0.48 * float(t[-1]), rng.uniform(0.2, 0.7)
    x_of_t, y_of_t = x + drift[0] * t, y + drift[1] * t
    return [occasion.finger(t, x_of_t, y_of_t, force=force, fade_in_s=half, fade_out_s=half)]


def diagonal_swipe(occasion: Occasion) -> list[Press]:
    """A swipe 31 to 59 degrees off the axes."""
    rng = occasion.rng
    heading = float(rng.choice([1, 3, 5, 7])) * math.pi / 4
    path = stroke(occasion, heading, swipe_length(occasion, heading) * 0.8, limit=math.radians(14.0))
    return fingers_on(occasion, path, int(rng.choice([1, 2], p=[0.85, 0.15])), heading)


def tap_then_swipe(occasion: Occasion) -> list[Press]:
    """A tap, and then a swipe that begins near it."""
    rng = occasion.rng
    heading = float(rng.choice([RIGHT, UP, LEFT, DOWN]))
    path = stroke(occasion, heading, swipe_length(occasion, heading))
    made = fingers_on(occasion, path, 1, heading)
    tap, gap = occasion.tap_s(), occasion.gap_s()
    moved = made[0]
    shifted = replace(moved, t=moved.t + tap + gap)
    near = rng.normal(0.0, 0.03, 2) * occasion.small
    return [touch_down(occasion, float(moved.x[0]) + near[0], float(moved.y[0]) + near[1], tap), shifted]


def press_and_slide(occasion: Occasion) -> list[Press]:
    """A finger that holds for 0.9 s or longer and then drags."""
    rng = occasion.rng
    heading = rng.uniform(-math.pi, math.pi)
    length = swipe_length(occasion, heading) * rng.uniform(0.5, 1.0)
    hold, move, after = rng.uniform(0.9, 2.0), rng.uniform(0.3, 1.2) / occasion.rate, rng.uniform(0.0, 0.4)
    t = grid(hold + move + after)
    x, y = arc(stroke_progress((t - hold) / move, rng), length, heading, rng.normal(0.0, 0.2))
    return drawn(occasion, t, x, y)


def triple_tap(occasion: Occasion) -> list[Press]:
    """Three or four taps in a row at about the same place."""
    rng = occasion.rng
    x, y = occasion.spot(4.0, 4.0)
    made, start = [], 0.0
    for _ in range(int(rng.choice([3, 4], p=[0.75, 0.25]))):
        duration = occasion.tap_s()
        dx, dy = rng.normal(0.0, 0.025, 2) * occasion.small
        made.append(touch_down(occasion, x + dx, y + dy, duration, start))
        start += duration + max(occasion.gap_s(), 0.11)
    return made


def taps_apart(occasion: Occasion) -> list[Press]:
    """Two taps as close in time as a double tap, but a third of the pad or more apart."""
    rng = occasion.rng
    apart = occasion.small * rng.uniform(0.38, 0.7)
    angle = rng.uniform(-math.pi, math.pi)
    dx, dy = 0.5 * apart * math.cos(angle), 0.5 * apart * math.sin(angle)
    x, y = occasion.spot(abs(dx), abs(dy))
    first = occasion.tap_s()
    return [
        touch_down(occasion, x - dx, y - dy, first),
        touch_down(occasion, x + dx, y + dy, occasion.tap_s(), first + occasion.gap_s()),
    ]


def tap_then_hold(occasion: Occasion) -> list[Press]:
    """A tap, and then a press of 0.9 s or longer at the same place."""
    rng = occasion.rng
    x, y = occasion.spot(3.0, 3.0)
    first = occasion.tap_s()
    dx, dy = rng.normal(0.0, 0.03, 2) * occasion.small
    return [
        touch_down(occasion, x, y, first),
        touch_down(occasion, x + dx, y + dy, rng.uniform(0.9, 2.0), first + occasion.gap_s()),
    ]


PRESSES: dict[str, Maker] = named(
    long_press, slow_touch, triple_tap, taps_apart, tap_then_hold, tap_then_swipe, press_and_slide, diagonal_swipe
)
OTHERS: dict[str, Maker] = PRESSES | DRAWN | SEVERAL | THINGS
