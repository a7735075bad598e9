"""The small picture of the pressure."""

import re

import numpy as np
import pytest

from gestured.client.picture import draw, trace
from gestured.control.show import Felt


def swipe_right(rows: int, columns: int) -> np.ndarray:
    frames = np.full((columns + 1, rows, columns), 400, np.uint16)
    for n in range(columns):
        frames[n + 1, rows // 2, n] += 500
    return frames


@pytest.mark.parametrize("grid", [(9, 9), (27, 15), (2, 2), (5, 64)])
def test_the_end_of_a_stroke_is_the_brightest(grid):
    picture = trace(swipe_right(*grid))
    assert picture.shape == (9, 9)
    row = picture[picture.max(axis=1).argmax()]
    assert (np.diff(row) >= 0).all()
    assert row[-1] == 1.0 and row[0] < 0.7


def test_the_idle_counts_and_their_scale_do_not_show():
    frames = swipe_right(9, 9)
    assert np.allclose(trace(frames), trace((frames - 400.0) * 7 + 90))


def test_what_is_drawn_in_place_is_not_wrapped_by_a_narrow_terminal():
    told = {"sensor": "demo", "state": "starting", "values": None}
    known = {"values": [0.0] * 81, "grid": [9, 9], "noise": 1.0, "phase": "RELEASING", "activity": 1234.5}
    for view in (told, told | known):
        assert max(map(len, Felt(colour=False).lines(view))) <= 40


def test_nothing_is_an_empty_picture():
    assert not trace(np.full((3, 9, 9), 7)).any()


def test_five_lines_of_nine_characters_with_colour_and_without():
    plain, coloured = (draw(trace(swipe_right(9, 9)), colour=colour) for colour in (False, True))
    seen = [re.sub("\x1b\\[[0-9;]*m", "", line) for line in coloured]
    assert [len(line) for line in plain] == [len(line) for line in seen] == [9] * 5
    assert "\x1b" not in "".join(plain) and all(line.endswith("\x1b[0m") for line in coloured)
    assert plain[2].strip() and not plain[0].strip()
