"""Touch-pattern features: a window worked out by hand, and what must not matter to them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.model.features import PRESSED, feature_names, touch_pattern

sizes = st.tuples(st.integers(1, 20), st.integers(2, 12), st.integers(2, 12))
seeds = st.integers(0, 2**16)


def pressed(size: tuple[int, int, int], seed: int) -> np.ndarray:
    """(T, R, C) float32 in which every frame shows contact."""
    rng = np.random.default_rng(seed)
    window = rng.uniform(0, 1, size) ** 3
    window[:, rng.integers(size[1]), rng.integers(size[2])] = rng.uniform(PRESSED + 0.01, 1, size[0])
    return window.astype(np.float32)


def named(window: np.ndarray, rate_hz: float = 15.0) -> dict[str, float]:
    names = feature_names(*window.shape[1:])
    values = touch_pattern(window, rate_hz)
    assert values.dtype == np.float32 and values.shape == (len(names),)
    return dict(zip(names, values.tolist(), strict=True))


def test_a_window_worked_out_by_hand() -> None:
    """Three frames of 2 x 3, the middle one idle."""
    window = np.array(
        [
            [[1.0, 0.5, 0.0], [0.1, 0.0, 0.2]],  # mean 0.3, 3 of 6 taxels pressed
            [[0.1, 0.1, 0.1], [0.1, 0.1, 0.1]],  # no contact: counts for nothing
            [[0.4, 0.0, 0.0], [0.2, 0.0, 0.0]],  # mean 0.1, 2 of 6
        ],
        dtype=np.float32,
    )
    expected = {
        "mean_pressure": 0.2, "maximum_pressure": 0.7, "variability": 0.1,
        "mean_taxel_variability": 0.7 / 6, "maximum_taxel_variability": 0.3,
        "row_0_mean": 1.9 / 6, "row_1_mean": 0.5 / 6,
        "column_0_mean": 1.7 / 4, "column_1_mean": 0.5 / 4, "column_2_mean": 0.2 / 4,
        "row_0_variability": 1.1 / 6, "row_1_variability": 0.1 / 6,
        "column_0_variability": 0.125, "column_1_variability": 0.125, "column_2_variability": 0.05,
        "row_0_maximum": 0.5, "row_1_maximum": 0.1,
        "column_0_maximum": 0.55, "column_1_maximum": 0.25, "column_2_maximum": 0.1,
        "maximum_area": 3 / 6, "mean_area": 2.5 / 6, "whole_area": 4 / 6, "duration_s": 2 / 20,
    }  # fmt: skip
    assert named(window, 20.0) == pytest.approx(expected, rel=1e-5)


@given(sizes, seeds, st.randoms(use_true_random=False))
def test_the_order_of_the_frames_does_not_matter(size: tuple[int, int, int], seed: int, random) -> None:
    window = pressed(size, seed)
    order = list(range(len(window)))
    random.shuffle(order)
    assert named(window[order]) == pytest.approx(named(window), rel=1e-5, abs=1e-6)


@given(sizes, seeds, st.integers(0, 9), st.integers(0, 9), st.floats(0, 0.19))
def test_idle_frames_change_nothing(
    size: tuple[int, int, int], seed: int, before: int, after: int, level: float
) -> None:
    window = pressed(size, seed)
    idle = [np.full((n, *size[1:]), level, dtype=np.float32) for n in (before, after)]
    assert named(np.concatenate([idle[0], window, idle[1]])) == named(window)


@given(sizes, seeds)
def test_a_mirrored_window_has_mirrored_features(size: tuple[int, int, int], seed: int) -> None:
    """What is said of a row or column follows it; the rest stays."""
    window = pressed(size, seed)
    mirrored = named(window[:, ::-1, ::-1])
    for name, value in named(window).items():
        line, _, what = name.partition("_")
        number, _, what = what.partition("_")
        if line in ("row", "column"):
            count = size[1] if line == "row" else size[2]
            name = f"{line}_{count - 1 - int(number)}_{what}"
        assert mirrored[name] == pytest.approx(value, rel=1e-5, abs=1e-6)


@given(sizes, st.sampled_from([0.0, 0.1, PRESSED, 1.0]), st.floats(0.1, 1000))
def test_a_constant_window_has_finite_features(size: tuple[int, int, int], value: float, rate_hz: float) -> None:
    with np.errstate(all="raise"):
        found = named(np.full(size, value, dtype=np.float32), rate_hz)
    assert np.isfinite(list(found.values())).all()
    assert found["mean_pressure"] == pytest.approx(value) and found["variability"] == pytest.approx(0, abs=1e-7)
    touched = size[0] if np.float32(value) >= PRESSED else 1
    assert found["duration_s"] == pytest.approx(touched / rate_hz)


@given(sizes)
def test_names_tell_features_apart(size: tuple[int, int, int]) -> None:
    names = feature_names(*size[1:])
    assert len(names) == len(set(names)) == len(touch_pattern(np.zeros(size, np.float32), 15.0))
