"""Trajectory features: what they say of paths that anyone can draw, and of windows that are no path at all."""

import numpy as np
import pytest
import torch
from torch import Tensor

from gestured.lab.trajectory import PATCH, PATH_POINTS, trajectory_features
from tests.lab.made import gestures, line, ring, window

MADE = gestures()
DURATION, RISES, LENGTH, REACH, STRAIGHT, EX, EY = 0, 2, 6, 7, 8, 9, 10
MX, MY, WINDING, AREA, TURNING, FINGERS = 20, 21, 22, 24, 26, 28


def features(frames: np.ndarray) -> Tensor:
    """The features (F,) of frames (T, R, C)."""
    return trajectory_features(torch.from_numpy(np.ascontiguousarray(frames, dtype=np.float32))[None])[0]


def parts(values: Tensor) -> dict[str, Tensor]:
    """The blocks by name, as `trajectory_features` puts them in a row."""
    sizes = {"single": len(values) - 4 * PATH_POINTS - 16 - PATCH * PATCH}
    sizes |= {"shape_x": PATH_POINTS, "shape_y": PATH_POINTS, "path_x": PATH_POINTS, "path_y": PATH_POINTS}
    sizes |= {"peaks": 4, "slot_x": 4, "slot_y": 4, "steps": 4, "blob": PATCH * PATCH}
    return dict(zip(sizes, torch.split(values, list(sizes.values())), strict=True))


@pytest.mark.parametrize("name", sorted(MADE))
@pytest.mark.parametrize("wait", [1, 4, 30])
def test_when_it_happened_does_not_matter(name: str, wait: int) -> None:
    late = np.concatenate([np.zeros((wait, 9, 9), np.float32), MADE[name]])
    torch.testing.assert_close(features(late), features(MADE[name]), atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("name", sorted(MADE))
def test_a_mirrored_window_has_mirrored_features(name: str) -> None:
    seen, mirrored = features(MADE[name]), features(MADE[name][:, :, ::-1])
    torch.testing.assert_close(mirrored.abs()[: -PATCH * PATCH], seen.abs()[: -PATCH * PATCH], atol=1e-4, rtol=1e-3)
    a, b = parts(seen), parts(mirrored)
    for block in ("shape_x", "path_x", "slot_x"):
        torch.testing.assert_close(b[block], -a[block], atol=1e-4, rtol=1e-3)
    for block in ("shape_y", "path_y", "slot_y", "peaks", "steps"):
        torch.testing.assert_close(b[block], a[block], atol=1e-4, rtol=1e-3)
    blob = a["blob"].reshape(PATCH, PATCH).flip(1).flatten()
    torch.testing.assert_close(b["blob"], blob, atol=1e-4, rtol=1e-3)
    for k in (EX, MX, WINDING, AREA, TURNING):
        assert float(b["single"][k]) == pytest.approx(-float(a["single"][k]), abs=1e-4)
    for k in (EY, MY, LENGTH, REACH):
        assert float(b["single"][k]) == pytest.approx(float(a["single"][k]), abs=1e-4)


@pytest.mark.parametrize("name", sorted(MADE))
def test_a_transposed_window_exchanges_x_and_y(name: str) -> None:
    """Reflected at the falling diagonal: right becomes down."""
    a, b = parts(features(MADE[name])), parts(features(MADE[name].transpose(0, 2, 1)))
    torch.testing.assert_close(b["path_y"], -a["path_x"], atol=1e-4, rtol=1e-3)
    torch.testing.assert_close(b["slot_x"], -a["slot_y"], atol=1e-4, rtol=1e-3)
    assert float(b["single"][EX]) == pytest.approx(-float(a["single"][EY]), abs=1e-4)


@pytest.mark.parametrize("sense", [-1, 1])
@pytest.mark.parametrize("begin", [0.3, 2.0, 3.7, 5.1])
def test_a_circle_winds_once_in_its_sense(sense: int, begin: float) -> None:
    found = features(window(ring(sense, begin=begin)))
    assert float(found[WINDING]) == pytest.approx(sense * 2 * np.pi, rel=0.15)
    assert np.sign(float(found[AREA])) == sense
    assert np.sign(float(found[TURNING])) == sense


def test_a_line_is_straight_and_a_circle_is_not() -> None:
    straight, round_ = features(window(line((1, 4), (7, 4)))), features(window(ring(1)))
    assert float(straight[STRAIGHT]) > 0.8
    assert float(round_[STRAIGHT]) < 0.3
    assert abs(float(straight[WINDING])) < 0.5


def test_contacts_fingers_and_time_are_counted() -> None:
    one, two = features(MADE["one_tap"]), features(MADE["double_tap"])
    assert (round(float(one[RISES])), round(float(two[RISES]))) == (1, 2)
    pair, single = features(MADE["swipe_up_two_fingers"]), features(MADE["swipe_up"])
    assert (round(float(single[FINGERS])), round(float(pair[FINGERS]))) == (1, 2)
    for steps in (3, 9, 30):
        assert float(features(window(line((4, 1), (4, 7), steps)))[DURATION]) == pytest.approx(steps / 15, abs=1e-5)


def test_the_path_is_the_same_however_fast_it_was() -> None:
    slow, fast = (parts(features(window(line((1, 2), (7, 6), steps)))) for steps in (40, 10))
    torch.testing.assert_close(slow["path_x"], fast["path_x"], atol=0.06, rtol=0)
    torch.testing.assert_close(slow["path_y"], fast["path_y"], atol=0.06, rtol=0)


ONE = np.zeros((1, 9, 9), np.float32)
ONE[0, 4, 4] = 1


@pytest.mark.parametrize(
    "frames",
    [
        np.zeros((1, 9, 9)), np.zeros((7, 9, 9)), ONE, np.ones((1, 9, 9)), np.ones((30, 9, 9)),
        np.full((5, 9, 9), 0.5), np.full((5, 9, 9), 0.12), np.full((3, 9, 9), 1e-30), np.full((3, 9, 9), 1e4),
        np.repeat(ONE, 80, axis=0), np.random.default_rng(0).random((200, 9, 9)),
        np.concatenate([ONE, np.zeros((50, 9, 9)), ONE]),
    ],
    ids=["silent frame", "silence", "one taxel", "all taxels", "all for long", "half", "at the floor", "denormal",
         "out of scale", "held", "noise", "far apart"],
)  # fmt: skip
def test_features_are_finite_and_of_one_length(frames: np.ndarray) -> None:
    found = features(frames)
    assert bool(torch.isfinite(found).all())
    assert found.shape == features(MADE["one_tap"]).shape
