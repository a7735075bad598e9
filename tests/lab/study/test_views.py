"""What methods see: the same of one window as of many, finite for whatever is short or constant."""

import numpy as np
import pytest

pytest.importorskip("torch")
pywt = pytest.importorskip("pywt")

from gestured.lab.study.methods import METHODS
from gestured.lab.study.motion_history import motion_history
from gestured.lab.study.training import Images, Windows
from gestured.lab.study.wavelets import band_statistics, spatio_temporal
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
    found = spatio_temporal(np.full((frames, 9, 9), level, np.float32))
    assert found.shape == (60,) and np.isfinite(found).all()


def test_statistics_against_a_second_opinion() -> None:
    stats = pytest.importorskip("scipy.stats")
    band = np.random.default_rng(0).normal(size=(30, 5)) ** 3
    found = band_statistics(band)
    expected = [np.abs(band).sum(0), np.linalg.norm(band, axis=0), stats.skew(band), stats.kurtosis(band), band.std(0)]
    assert np.allclose(found, expected)


def test_wavelets_keep_the_energy_of_a_gesture() -> None:
    signals = gestures()["swipe_up"][:8].reshape(8, -1).astype(float)
    bands = pywt.wavedec(signals, "haar", level=3, axis=0)
    assert np.isclose(sum((band**2).sum() for band in bands), (signals**2).sum())


def test_a_motion_history_is_brightest_where_the_finger_was_last() -> None:
    right = motion_history(window(line((1, 4), (7, 4))))
    left = motion_history(window(line((7, 4), (1, 4))))
    assert (np.diff(right[4, 1:8]) >= 0).all() and right[4, 7] > right[4, 1] > 0
    assert np.allclose(right, left[:, ::-1], atol=0.15)


def test_idle_frames_at_the_end_leave_the_motion_history_as_it_is() -> None:
    frames = gestures()["circle_clockwise"]
    longer = np.concatenate([frames, np.zeros((9, 9, 9), np.float32)])
    assert np.array_equal(motion_history(frames), motion_history(longer))
