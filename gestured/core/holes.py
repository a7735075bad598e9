"""What may have happened while nobody saw the finger.

A hole may hide a turn, a lift, a second tap or a circle. It hides none of them where the finger goes on behind it as it
came: straight on, or along the same bend, hardly slower than before; or where it had moved and rests on both sides.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from gestured.core.contact import Place

HOLE_S = 0.25  # longer without a frame, nobody knows what the finger did meanwhile
HOLE_FRAMES = 2.5  # of the sensor's own intervals: a slow one may take so many, whatever the seconds
CLEAR_S = 0.45  # five frames lost in a row at 15 Hz; however clear the path, longer is too long
SIDE = 3  # frames at most on each side of a hole from which its way is taken
RESTS = 0.5  # taxel pitches: a shorter way has no direction, and a finger that goes no further rests
STRAIGHT = math.radians(40.0)  # angle up to which the way across the hole goes straight on from the way beside it
BENT = math.radians(75.0)  # the same angle where both ways bend to the same side, as on a circle
SLOWEST = 0.75  # times the speed beside the hole: who got less far has turned a corner, or stopped


def bearable_s(interval_s: float) -> float:
    """Seconds that a hole may last before it counts against a contact, where frames are `interval_s` apart."""
    return max(HOLE_S, HOLE_FRAMES * interval_s)


class Sight(NamedTuple):
    """Where the finger was seen."""

    t: float  # s
    place: Place


def clear(before: Sequence[Sight], after: Sequence[Sight], travel: float) -> bool:
    """Whether nothing hides between the last of `before` and the first of `after`, all that was seen of a contact.

    `travel`: taxel pitches that a finger may move and still be where it was.
    """
    if len(before) < 2 or len(after) < 2 or after[0].t - before[-1].t > CLEAR_S:
        return False
    across = _way(before[-1], after[0])
    sides = (before[-SIDE:], after[:SIDE])
    ways = [_way(side[0], side[-1]) for side in sides]
    if math.hypot(*across) < travel:
        came = max(math.dist(one.place, before[-1].place) for one in before)
        return came >= 2 * travel and all(math.hypot(*way) < RESTS for way in ways)
    bends = [_turn(way, across) for way in ways if math.hypot(*way) >= RESTS]
    one_way = len(bends) == 2 and bends[0] * bends[1] < 0  # the way before turns to it, the way after turned from it
    if not bends or max(map(abs, bends)) > (BENT if one_way else STRAIGHT):
        return False
    usual = sum(math.hypot(*way) for way in ways) / sum(side[-1].t - side[0].t for side in sides)
    return math.hypot(*across) >= SLOWEST * usual * (after[0].t - before[-1].t)


def _way(one: Sight, other: Sight) -> Place:
    return other.place[0] - one.place[0], other.place[1] - one.place[1]


def _turn(one: Place, other: Place) -> float:
    """Radians from one way to another, positive to one side."""
    return math.atan2(one[0] * other[1] - one[1] * other[0], one[0] * other[0] + one[1] * other[1])
