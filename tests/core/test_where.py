"""Where a contact was: fingers drawn with known places, and what an answer says of them."""

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gestured.core.cutter import LARGEST
from gestured.core.events import Gesture, Place, Unknown, Where
from gestured.core.frames import Segment
from gestured.core.mounting import Mounting
from gestured.core.scene import Setup
from gestured.core.spots import Spot
from gestured.core.spots import spots as spots_in
from gestured.core.where import where as where_in
from tests.core.test_sensor import SWIPE, Fake, answers, recognizer, run, says
from tests.scenario import frames

Array = NDArray[np.float64]
Path = list[tuple[float, float]]
where = partial(where_in, zones={})


def spots(frame: Array, noise: float = 2.0) -> list[Spot]:
    """The fingers of an (R, C) frame."""
    return spots_in(frame.ravel(), frame.shape, noise)


def drawn(
    *fingers: tuple[float, float], grid: tuple[int, int] = (9, 9), width: float = 0.8, peak: float = 500
) -> Array:
    """A frame with fingers at these rows and columns."""
    rows, columns = np.indices(grid)
    shapes = [np.exp(-((rows - row) ** 2 + (columns - column) ** 2) / (2 * width**2)) for row, column in fingers]
    return peak * np.sum(shapes, axis=0) if shapes else np.zeros(grid)


def segment(*moments: Path, noise: float = 2.0, **how: Any) -> Segment:
    """A segment whose frames have fingers at these places; two quiet frames stand before it and after it."""
    told = [[], [], *moments, [], []]
    values = np.array([drawn(*fingers, **how) for fingers in told], np.float32)
    return Segment(values, np.arange(len(told)) / 15, 2, len(told) - 3, noise)


@given(
    st.sampled_from([(9, 9), (27, 15), (5, 12)]), st.floats(0, 1), st.floats(0, 1), st.floats(0.55, 1.3), st.integers(0)
)
def test_a_finger_is_found_to_a_fraction_of_a_taxel_at_the_border_too(
    grid: tuple[int, int], down: float, across: float, width: float, seed: int
) -> None:
    row, column = down * (grid[0] - 1), across * (grid[1] - 1)
    frame = drawn((row, column), grid=grid, width=width) + np.random.default_rng(seed).normal(0, 2, grid)
    (spot,) = spots(frame)
    assert math.dist((spot.row, spot.column), (row, column)) < 0.4  # the worst is a corner, of which a quarter is seen
    assert spot.peak == frame.max()
    assert spot.area == np.count_nonzero(frame > spot.peak / 2)


def test_the_border_pulls_no_place_inwards() -> None:
    """A centroid of the same taxels is off by more than a third of a pitch there."""
    rng = np.random.default_rng(0)
    places = [(rng.uniform(0, 0.5), rng.uniform(1, 7), rng.uniform(0.6, 1.2)) for _ in range(200)]
    off = [spots(drawn((row, column), width=width))[0].row - row for row, column, width in places]
    assert abs(np.median(off)) < 0.03 and np.percentile(np.abs(off), 95) < 0.2


@given(st.floats(2.5, 6), st.floats(0, math.tau), st.floats(0.6, 1), st.integers(0, 2**32))
def test_two_fingers_that_are_far_enough_apart_are_two(apart: float, angle: float, width: float, seed: int) -> None:
    step = apart / 2 * math.sin(angle), apart / 2 * math.cos(angle)
    places = sorted([(4 + step[0], 4 + step[1]), (4 - step[0], 4 - step[1])])
    frame = drawn(*places, width=width) + np.random.default_rng(seed).normal(0, 2, (9, 9))
    assume(apart >= 3.4 * width)  # nearer, broad fingers are one hill
    one, other = ((spot.row, spot.column) for spot in spots(frame))
    assert min(max(math.dist(one, a), math.dist(other, b)) for a, b in (places, places[::-1])) < 0.6


def test_a_line_is_as_long_as_it_is_and_a_finger_that_rests_goes_nowhere() -> None:
    across = [[(4.0, column)] for column in np.linspace(1, 7, 8)]
    line = where(segment(*across))
    assert (line.start.x, line.start.y, line.end.x, line.end.y) == pytest.approx((0.125, 0.5, 0.875, 0.5), abs=0.02)
    assert line.way == pytest.approx(0.75, abs=0.01) and line.contacts == 1 and line.zone is None
    rng = np.random.default_rng(0)
    rest = where(segment(*[[tuple(rng.normal(4, 0.1, 2))] for _ in range(30)]))
    assert rest.way == 0.0


def test_a_line_from_border_to_border_reaches_both() -> None:
    line = where(segment(*[[(row, 4.0)] for row in np.linspace(8.3, -0.3, 9)]))  # a finger's middle may lie beyond
    assert (line.start.y, line.end.y) == (0.0, 1.0)


def test_two_fingers_begin_and_end_half_way_between_them() -> None:
    up = where(segment(*[[(row, 2.0), (row, 6.0)] for row in np.linspace(7, 1, 7)]))
    assert up.contacts == 2 and up.way == pytest.approx(0.75, abs=0.02)
    assert (up.start.x, up.start.y) == pytest.approx((0.5, 0.125), abs=0.02)


def test_pressure_is_in_counts_and_over_the_noise() -> None:
    found = where(segment([(4.0, 4.0)], [(4.0, 4.0)], noise=2.5, peak=212.0))
    assert (found.pressure, found.snr) == (212.0, 84.8)


def test_bad_taxels_under_the_way_are_counted_also_between_two_frames() -> None:
    bad = np.zeros((9, 9), dtype=bool)
    bad[4, 4] = bad[3, 5] = bad[0, 0] = True
    swept = segment([(4.0, 1.0)], [(4.0, 7.0)])
    assert where(replace(swept, bad=bad)).bridged == 2
    assert where(swept).bridged == where(replace(swept, bad=np.zeros_like(bad))).bridged == 0


@given(
    st.sampled_from([(2, 2), (2, 9), (9, 9)]),
    st.integers(1, 5),
    st.sampled_from(["one taxel", "flat", "noise", "nothing", "huge", "below"]),
    st.sampled_from([1e-300, 2.0]),
    st.integers(0, 2**32),
)
def test_whatever_the_taxels_show_has_an_answer(
    grid: tuple[int, int], count: int, what: str, noise: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    values = np.zeros((count, *grid), np.float32)
    if what == "one taxel":
        values[:, rng.integers(grid[0]), rng.integers(grid[1])] = 300
    elif what != "nothing":
        values += {"flat": 5.0, "huge": LARGEST, "below": -3.0, "noise": 0.0}[what]
        values += rng.normal(0, 3, values.shape) if what == "noise" else 0
    bad = rng.random(grid) < 0.5
    found = where(Segment(values, np.arange(count) / 15, 0, count - 1, noise, bad=bad))
    assert all(0 <= at <= 1 for end in (found.start, found.end) for at in (end.x, end.y))
    assert all(map(math.isfinite, (found.way, found.pressure, found.snr))) and found.contacts in (1, 2)


def test_a_sensor_of_two_by_two_tells_its_corners_apart() -> None:
    for corner, expected in (((0, 0), Place(0, 1)), ((1, 1), Place(1, 0))):
        at = where(segment([corner], [corner], grid=(2, 2))).start
        assert math.dist((at.x, at.y), (expected.x, expected.y)) < 0.25
    middle = where(segment([(0.5, 0.5)], grid=(2, 2))).start
    assert math.dist((middle.x, middle.y), (0.5, 0.5)) < 0.15


@given(st.integers(0, 2**32), st.sampled_from([(9, 9), (7, 12)]))
def test_a_sensor_that_is_turned_or_mirrored_turns_and_mirrors_the_places(seed: int, grid: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    row, column = (rng.uniform(0, side - 1, 2) for side in grid)
    path = [[(row[0] + s * (row[1] - row[0]), column[0] + s * (column[1] - column[0]))] for s in np.linspace(0, 1, 6)]
    usual = segment(*path, grid=grid)
    plain = where(usual)
    mirrored = where(replace(usual, frames=usual.frames[:, :, ::-1].copy()))
    assert mirrored.start.x == pytest.approx(1 - plain.start.x, abs=2e-4)
    turned = where(replace(usual, frames=np.rot90(usual.frames, -1, (1, 2)).copy()))
    assert (turned.end.x, turned.end.y) == pytest.approx((plain.end.y, 1 - plain.end.x), abs=2e-4)
    assert turned.way == pytest.approx(plain.way, abs=1e-3)


# --- what an answer says


def told(
    *lines: str, dead: tuple[int, int] | None = None, mounting: Mounting | None = None, confidence: float = 0.9
) -> Where:
    """Where the one answer to these lines was, on a sensor of which one taxel may show nothing."""
    setup = {"armrest": Setup(mounting=mounting or Mounting())}
    subject = recognizer(Fake([says(0.05, confidence, 0.05)]), sensors=setup)
    stream = frames("quiet for 1500ms", *lines, "quiet for 900ms")
    for frame in stream if dead else ():
        frame.values[dead] = 0.0
    (answer,) = answers(run(subject, stream))
    assert isinstance(answer, Gesture if confidence > 0.5 else Unknown) and answer.where is not None
    return answer.where


@pytest.mark.parametrize("confidence", [0.9, 0.2])
def test_gestures_and_unknown_say_where_they_were(confidence: float) -> None:
    found = told(SWIPE, confidence=confidence)  # row 4, from column 1 to 7
    assert found.start.x < 0.3 and found.end.x > 0.75 and found.way > 0.5
    assert found.start.y == pytest.approx(0.5, abs=0.05) and found.pressure > 300 and found.snr > 100


def test_an_answer_says_that_its_way_led_over_a_bad_taxel_and_is_as_long_as_without() -> None:
    over, beside = told(SWIPE, dead=(4, 4)), told(SWIPE, dead=(8, 4))
    assert (over.bridged, beside.bridged) == (1, 0)
    assert over.way == pytest.approx(beside.way, abs=0.05) and over.contacts == 1


def test_places_are_as_a_person_in_front_of_the_sensor_sees_them() -> None:
    downward = "move 1,4 to 7,4 0.8 in 400ms"
    found = told(downward, mounting=Mounting(rotate=90))  # turned clockwise: to the left
    assert found.start.x > 0.7 and found.end.x < 0.25
