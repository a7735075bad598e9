"""The study's wavelet features: the second way to compute them, with 50 digits, says the same."""

from typing import Any

import numpy as np
import pytest

from gestured.lab.stability import wavelet_features
from gestured.lab.stability.wavelet_features import exact_features, features_of, wavelets_table
from tests.lab.made import gestures

WINDOWS = [gestures()["swipe_up"], gestures()["one_tap"]]


@pytest.mark.parametrize("frames", [1, 2, 7, 8, 9, 21])
def test_both_ways_agree_at_every_length(frames: int) -> None:
    window = np.random.default_rng(frames).random((frames, 2, 3)).astype(np.float32)
    assert np.abs(features_of(window) - exact_features(window)).max() < 1e-5


def test_a_table_says_how_far_they_are_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    rows: list[Any] = wavelets_table(WINDOWS, WINDOWS[:1]).rows
    assert [row[0] for row in rows] == list(wavelet_features.STATISTICS)
    assert all(max(row[1:3]) < 1e-6 for row in rows)
    assert all(0 < row[3] <= row[4] for row in rows)  # float16 windows are other windows
    usual = wavelet_features.features_of
    monkeypatch.setattr(wavelet_features, "features_of", lambda window: usual(window) * 1.01)
    worse: list[Any] = wavelets_table(WINDOWS, WINDOWS[:1]).rows
    assert all(row[1] > 1e-3 for row in worse)
