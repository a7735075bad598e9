"""Touch-pattern features: a window worked out by hand, constant ones, and names."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.model.features import PRESSED, feature_names, touch_pattern

sizes = st.tuples(st.integers(1, 20), st.integers(2, 12), st.integers(2, 12))


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
