"""What methods see: the same of one window as of many, finite for whatever is short or constant."""

import numpy as np
import pytest
from scipy import stats

from gestured.lab.study.methods import METHODS
from gestured.lab.study.training import Images, Windows
from gestured.lab.study.views import POOLED, band_statistics, motion_history, paper_features, spatio_temporal
from tests.lab.made import gestures, line, window
from tests.lab.study.material_made import samples


@pytest.mark.parametrize("name", METHODS)
def test_one_window_looks_as_it_does_among_all(name: str) -> None:
    made, method = samples(1), METHODS[name]
    values = method.grid[0]
    seen = method.view.all(made, values, False)
    for i in range(len(made)):
        one = method.view.one(made.window(i), values)[0]
        if isinstance(seen, Windows):
            assert np.array_equal(one, made.window(i))
        else:
            among = seen.images[i] if isinstance(seen, Images) else seen[i]
            assert np.allclose(one, among, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("frames", [1, 2, 7, 8, 9, 60])
@pytest.mark.parametrize("level", [0.0, 1.0])
def test_wavelet_features_of_a_constant_signal_are_finite(frames: int, level: float) -> None:
    found = spatio_temporal(np.full((1, frames, 9, 9), level, np.float32))[0]
    assert found.shape == (4 * 5 * (81 + 3),) and np.isfinite(found).all()


def test_the_two_readings_of_the_wavelet_features() -> None:
    """The paper's reading still knows which taxel it was; the pooled one is its last part."""
    swipe = gestures()["swipe_up"]
    turned = swipe[:, ::-1]
    whole, mirrored = spatio_temporal(np.stack([swipe, turned]))
    pooled, pooled_mirrored = spatio_temporal(np.stack([swipe, turned]), reading=POOLED)
    assert np.array_equal(whole[-len(pooled) :], pooled)
    assert np.allclose(pooled, pooled_mirrored, rtol=1e-5) and not np.allclose(whole, mirrored, rtol=1e-2)


def test_touch_patterns_are_the_papers() -> None:
    """Against its sentences, written down by hand for two frames of 2 x 2 taxels."""
    window = np.array([[[1.0, 0.5], [0.0, 0.0]], [[0.2, 0.0], [0.0, 0.6]]], np.float32)
    found = paper_features(window)
    mean, variability = 2.3 / 8, (0.8 + 0.5 + 0.0 + 0.6) / 4
    rows, columns = [1.7 / 4, 0.6 / 4], [1.2 / 4, 1.1 / 4]
    assert np.allclose(found, [mean, 1.0, variability, *rows, *columns, 0.5, 0.5, 2 / 15])
    assert np.array_equal(paper_features(np.concatenate([window, np.zeros((5, 2, 2), np.float32)])), found)
    assert np.isfinite(paper_features(window[:1])).all() and np.isfinite(paper_features(0 * window)).all()


def test_statistics_against_a_second_opinion() -> None:
    band = np.random.default_rng(0).normal(size=(30, 5)) ** 3
    (found,) = band_statistics(band[np.newaxis])
    expected = [np.abs(band).sum(0), np.linalg.norm(band, axis=0), stats.skew(band), stats.kurtosis(band), band.std(0)]
    assert np.allclose(found, expected)


def test_a_motion_history_is_brightest_where_the_finger_was_last() -> None:
    right = motion_history(window(line((1, 4), (7, 4))))
    left = motion_history(window(line((7, 4), (1, 4))))
    assert (np.diff(right[4, 1:8]) >= 0).all() and right[4, 7] > right[4, 1] > 0
    assert np.allclose(right, left[:, ::-1], atol=0.15)


def test_idle_frames_at_the_end_leave_the_motion_history_as_it_is() -> None:
    frames = gestures()["circle_clockwise"]
    longer = np.concatenate([frames, np.zeros((9, 9, 9), np.float32)])
    assert np.array_equal(motion_history(frames), motion_history(longer))
