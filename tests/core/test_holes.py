"""Holes in a contact: where nothing can hide in one, and where something may."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.core.contact import Centroid
from gestured.core.cutter import Sight, clear

STEP_S = 1 / 15
TRAVEL = 1.35  # taxel pitches, of a sensor of 9 x 9

Path = Callable[[float], Centroid]  # s -> where the finger is

speeds = st.floats(8.0, 40.0)  # taxel pitches a second: from frame to frame, a way that has a direction
headings = st.floats(-math.pi, math.pi)
Hole = tuple[int, int, int]  # frames seen before it, lost in it, seen after it
holes = st.tuples(st.integers(2, 8), st.integers(3, 5), st.integers(2, 8))


def seen(path: Path, hole: Hole) -> tuple[list[Sight], list[Sight]]:
    """What is seen of a finger on both sides of a hole."""
    before, missing, after = hole
    sights = [(n * STEP_S, path(n * STEP_S)) for n in range(before + missing + after)]
    return sights[:before], sights[before + missing :]


def straight(heading: float, speed: float) -> Path:
    return lambda t: (speed * t * math.sin(heading), speed * t * math.cos(heading))


@given(headings, speeds, holes, st.floats(1.4, math.tau - 1.4))
def test_a_finger_that_turned_behind_the_hole_may_have_done_so_in_it(
    heading: float, speed: float, hole: Hole, turn: float
) -> None:
    came, went = seen(straight(heading, speed), hole)
    (begun, (row, column)), goes = went[0], straight(heading + turn, speed)
    ways = [(t, goes(t - begun)) for t, _ in went]
    went = [(t, (row + down, column + across)) for t, (down, across) in ways]
    assert not clear(came, went, TRAVEL)


@pytest.mark.parametrize(("came", "hides"), [(6.0, False), (2.0, True)])
def test_a_rest_at_the_end_of_a_stroke_hides_nothing_but_a_tap_does(came: float, hides: bool) -> None:
    end = 5 * STEP_S
    stroke = straight(0.3, came / end)
    assert clear(*seen(lambda t: stroke(min(t, end)), (9, 4, 3)), TRAVEL) is not hides


@pytest.mark.parametrize(("before", "after"), [(1, 5), (5, 1), (0, 5), (5, 0)])
def test_a_single_sight_has_no_direction(before: int, after: int) -> None:
    assert not clear(*seen(straight(0.0, 10.0), (before, 3, after)), TRAVEL)


@given(headings, speeds, holes, st.floats(0.0, 0.7))
def test_a_finger_that_got_less_far_than_it_was_fast_is_not_clear(
    heading: float, speed: float, hole: Hole, share: float
) -> None:
    came, went = seen(straight(heading, speed), hole)
    less = straight(heading, (1 - share) * speed)((hole[1] + 1) * STEP_S)
    went = [(t, (row - less[0], column - less[1])) for t, (row, column) in went]
    assert not clear(came, went, TRAVEL)
