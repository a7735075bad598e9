"""Few counts: what is rounded has the peak that was asked for, and what is too coarse is missed, not misread."""

from typing import Any

import numpy as np
import pytest

from experiments import coarse
from gestured.lab.stability.path import simulated_series
from gestured.model.opening import open_model


@pytest.mark.parametrize("counts", [2, 5, 100])
def test_a_coarse_stream_has_the_peak_that_was_asked_for(counts: int) -> None:
    ((_, stream),) = simulated_series(1)
    found = coarse.with_peak(stream, counts)
    assert np.array_equal(found.frames, np.rint(found.frames))
    above = found.frames - np.median(found.frames, axis=0)
    assert abs(float(above.max()) - counts) <= 1


def test_many_counts_are_as_good_as_all_and_two_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coarse, "PEAKS", (2, 1000))
    rows: list[Any] = coarse.coarse_table({"cnn_lstm": open_model("cnn_lstm")}, 10).rows
    plain, two, thousand = (row[1] for row in rows)
    share = [float(cell.split()[0]) for cell in (plain, two, thousand)]
    assert share[0] >= 90 and share[2] == share[0] and share[1] < share[0]
