"""Holes in a contact: where nothing can hide in one, and where something may."""

import math
from collections.abc import Callable

import pytest
from hypothesis import assume, given
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


def circle(radius: float, period: float) -> Path:
    return lambda t: (radius * math.sin(math.tau * t / period), radius * math.cos(math.tau * t / period))


@given(headings, speeds, holes)
def test_a_finger_that_goes_straight_on_hides_nothing(heading: float, speed: float, hole: Hole) -> None:
    assert clear(*seen(straight(heading, speed), hole), TRAVEL)


@given(st.floats(1.5, 3.5), st.floats(1.2, 2.5), holes)
def test_a_finger_that_follows_the_same_bend_hides_nothing(radius: float, period: float, hole: Hole) -> None:
    assume(math.tau * radius / period > 8.0 and (hole[1] + 1) * STEP_S < 0.3 * period)
    assert clear(*seen(circle(radius, period), hole), TRAVEL)


@given(headings, speeds, st.tuples(st.integers(2, 8), st.integers(6, 20), st.integers(2, 8)))
def test_nobody_knows_what_was_done_in_a_longer_time(heading: float, speed: float, hole: Hole) -> None:
    assert not clear(*seen(straight(heading, speed), hole), TRAVEL)


@given(headings, st.floats(0.0, 1.2), st.tuples(st.integers(1, 20), st.integers(3, 5), st.integers(1, 8)))
def test_where_a_finger_stays_a_second_tap_may_hide(heading: float, length: float, hole: Hole) -> None:
    speed = length / (sum(hole) * STEP_S)
    assert not clear(*seen(straight(heading, speed), hole), TRAVEL)


@given(headings, speeds, holes, st.floats(1.4, math.tau - 1.4))
def test_a_finger_that_turned_behind_the_hole_may_have_done_so_in_it(
    heading: float, speed: float, hole: Hole, turn: float
) -> None:
    came, went = seen(straight(heading, speed), hole)
    (begun, (row, column)), goes = went[0], straight(heading + turn, speed)
    ways = [(t, goes(t - begun)) for t, _ in went]
    went = [(t, (row + down, column + across)) for t, (down, across) in ways]
    assert not clear(came, went, TRAVEL)


@given(headings, speeds, holes)
def test_a_finger_that_came_back_is_not_clear(heading: float, speed: float, hole: Hole) -> None:
    there = straight(heading, speed)
    turn = (hole[0] + hole[1] / 2) * STEP_S
    assert not clear(*seen(lambda t: there(min(t, 2 * turn - t)), hole), TRAVEL)


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
