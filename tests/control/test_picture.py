"""The small picture of the pressure."""

import re

import numpy as np
import pytest

from gestured.client.picture import RAMP, draw, moving, trace


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


def test_nothing_is_an_empty_picture():
    assert not trace(np.full((3, 9, 9), 7)).any()


def test_without_colour_five_lines_of_nine_characters():
    lines = draw(trace(swipe_right(9, 9)), colour=False)
    assert [len(line) for line in lines] == [9] * 5
    assert "\x1b" not in "".join(lines)
    assert lines[2].strip() and not lines[0].strip()


def test_with_colour_the_same_size_on_a_screen():
    lines = draw(trace(swipe_right(9, 9)), colour=True)
    seen = [re.sub("\x1b\\[[0-9;]*m", "", line) for line in lines]
    assert [len(line) for line in seen] == [9] * 5
    assert all(line.endswith("\x1b[0m") for line in lines)


def plain(text: str) -> str:
    return re.sub("\x1b\\[[0-9;]*m", "", text)


@pytest.mark.parametrize(("grid", "zoom"), [((9, 9), 3), ((27, 15), 1), ((2, 2), 14), ((64, 64), 1), ((5, 64), 1)])
@pytest.mark.parametrize("colour", [True, False])
def test_a_moving_picture_fits_a_small_terminal(grid, zoom, colour):
    lines = moving(np.zeros(grid), [], 100.0, colour)
    assert len({len(plain(line)) for line in lines}) == 1
    assert len(lines) <= 16 and len(plain(lines[0])) <= 40 and ("\x1b" in lines[0]) == colour


def test_the_finger_is_where_it_presses_and_points_where_it_goes():
    for way, arrow in (((0, 1), "→"), ((0, -1), "←"), ((1, 0), "↓"), ((-1, 0), "↑"), ((1, 1), "↘"), ((-1, 1), "↗")):
        path = [(4 + n * way[0], 4 + n * way[1]) for n in range(4)]
        values = np.zeros((9, 9))
        row, column = path[-1]
        values[row, column] = 100
        for colour in (False, True):
            text = [plain(line) for line in moving(values, path, 100.0, colour)]
            (line,) = [n for n, one in enumerate(text) if arrow in one]
            assert line == int((row + 0.5) * 3 / 2) and text[line].index(arrow) // 3 == column
    still = moving(values, [(4.0, 4.0)] * 5, 100.0, False)
    assert not any(arrow in line for line in still for arrow in "→←↓↑↘↗↖↙")


def test_the_scale_is_fixed_and_the_colours_differ_in_brightness():
    def grey(code: int) -> float:
        """The brightness of one of the 216 colours of a terminal."""
        levels = [0, 95, 135, 175, 215, 255]
        r, g, b = (levels[(code - 16) // n % 6] for n in (36, 6, 1))
        return 0.2126 * r + 0.7152 * g + 0.0722 * b

    assert [grey(code) for code in RAMP] == sorted({grey(code) for code in RAMP})
    half = moving(np.full((9, 9), 50.0), [], 100.0, True)
    assert half == moving(np.full((9, 9), 500.0), [], 1000.0, True) != moving(np.full((9, 9), 50.0), [], 50.0, True)
