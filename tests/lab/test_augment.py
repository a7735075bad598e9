"""Augmentation: a turned window carries the name of what it shows, and variation invents nothing."""

import itertools

import numpy as np
import pytest
import torch
from torch import Tensor

from gestured.lab.augment import MIRROR, TURN, symmetry_table, turned, varied
from gestured.lab.fit import CLASSES
from gestured.simulator import GESTURES
from tests.lab.made import direction, direction_of, gestures

TABLE = symmetry_table(CLASSES)
SYMMETRIES = range(8)


def after(label: str, symmetry: int) -> str:
    return CLASSES[int(TABLE[symmetry, CLASSES.index(label)])]


def turn(frames: np.ndarray, symmetry: int) -> np.ndarray:
    return turned(torch.from_numpy(np.asarray(frames, np.float32))[None], symmetry)[0].numpy()


@pytest.mark.parametrize("gesture", GESTURES)
def test_what_becomes_of_each_gesture_is_said(gesture: str) -> None:
    assert gesture in TURN, f"TURN in gestured/lab/augment.py does not say what {gesture} is after a quarter turn"
    assert gesture in MIRROR, f"MIRROR in gestured/lab/augment.py does not say what {gesture} is in a mirror"


@pytest.mark.parametrize("symmetry", SYMMETRIES)
@pytest.mark.parametrize("label", sorted(gestures()))
def test_a_turned_window_shows_what_the_table_calls_it(label: str, symmetry: int) -> None:
    frames = gestures()[label]
    assert direction(frames) == direction_of(label)
    assert direction(turn(frames, symmetry)) == direction_of(after(label, symmetry))


def test_the_number_of_fingers_survives_every_symmetry() -> None:
    for label, symmetry in itertools.product(CLASSES, SYMMETRIES):
        assert ("two_finger" in after(label, symmetry)) == ("two_finger" in label)


def test_names_compose_as_the_turns_do() -> None:
    x = torch.rand(1, 2, 5, 5, generator=torch.Generator().manual_seed(3))
    shown = [turned(x, s) for s in SYMMETRIES]
    for first, second in itertools.product(SYMMETRIES, SYMMETRIES):
        both = turned(turned(x, first), second)
        (single,) = [s for s in SYMMETRIES if torch.equal(both, shown[s])]
        assert torch.equal(TABLE[second][TABLE[first]], TABLE[single])
    assert torch.equal(TABLE[0], torch.arange(len(CLASSES)))


def padded_batch(tail: int = 6) -> Tensor:
    made = list(gestures().values())
    time = max(map(len, made)) + tail
    x = torch.zeros(len(made), time, 9, 9)
    for row, frames in enumerate(made):
        x[row, : len(frames)] = torch.from_numpy(frames)
        x[row, len(frames) - 1] = 0.02  # a quiet frame is not a silent one
    return x


def test_variation_keeps_the_scale_and_leaves_padding_alone() -> None:
    x = padded_batch()
    for seed in range(40):
        y = varied(x, torch.Generator().manual_seed(seed))
        assert y.shape == x.shape
        assert bool(torch.isfinite(y).all())
        assert float(y.min()) >= 0
        assert torch.allclose(y.amax((1, 2, 3)), torch.ones(len(y)))
        for row, frames in enumerate(gestures().values()):
            assert float(y[row, len(frames) :].max()) == 0.0


def test_variation_is_the_generators_alone() -> None:
    x = padded_batch()
    torch.manual_seed(1)
    first = varied(x, torch.Generator().manual_seed(9))
    torch.manual_seed(2)
    assert torch.equal(first, varied(x, torch.Generator().manual_seed(9)))
    assert not torch.equal(first, varied(x, torch.Generator().manual_seed(10)))


@pytest.mark.parametrize("time", [1, 2, 3, 4])
def test_variation_takes_short_and_silent_windows(time: int) -> None:
    x = torch.zeros(3, time, 9, 9)
    x[0, 0, 4, 4] = 1.0
    for seed in range(10):
        y = varied(x, torch.Generator().manual_seed(seed))
        assert bool(torch.isfinite(y).all())
        assert float(y[0].max()) == pytest.approx(1.0)


def test_variation_keeps_the_direction() -> None:
    names = list(gestures())
    for seed in range(10):
        y = varied(padded_batch(), torch.Generator().manual_seed(seed))
        for row, label in enumerate(names):
            if "swipe" in label:
                assert direction(y[row].numpy()) == direction_of(label), (label, seed)
