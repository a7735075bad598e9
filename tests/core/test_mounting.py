"""Mounting: a frame is turned clockwise, after the mirror."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gestured.core.mounting import Mounting

Shape = tuple[int, int]

grids = st.tuples(st.integers(2, 64), st.integers(2, 64))
turns = st.sampled_from([0, 90, 180, 270])


@given(grids, turns, turns, st.booleans())
def test_turns_add_up_and_the_mirror_comes_first(grid: Shape, one: int, two: int, mirror: bool) -> None:
    sent = np.arange(grid[0] * grid[1]).reshape(grid)
    apart = Mounting(two).frame(Mounting(one, mirror).frame(sent))
    assert np.array_equal(apart, Mounting((one + two) % 360, mirror).frame(sent))
    assert np.array_equal(Mounting(one).frame(Mounting(0, True).frame(sent)), Mounting(one, True).frame(sent))
    assert np.array_equal(Mounting(0, True).frame(Mounting(0, True).frame(sent)), sent)


def test_turns_are_clockwise_and_the_mirror_swaps_left_and_right() -> None:
    sent = np.array([[1, 2], [3, 4], [5, 6]])
    assert Mounting(90).frame(sent).tolist() == [[5, 3, 1], [6, 4, 2]]
    assert Mounting(270).frame(sent).tolist() == [[2, 4, 6], [1, 3, 5]]
    assert Mounting(180).frame(sent).tolist() == [[6, 5], [4, 3], [2, 1]]
    assert Mounting(0, True).frame(sent).tolist() == [[2, 1], [4, 3], [6, 5]]
