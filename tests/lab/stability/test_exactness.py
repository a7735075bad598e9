"""Extreme windows against float64, and the price of denormals: what the tables promise of the shipped models."""

from typing import Any

import numpy as np
import pytest

from gestured.lab.stability import denormals, exactness
from gestured.lab.stability.ways import by_reference
from gestured.model.shipped import LADDER, shipped
from tests.lab.made import gestures


def test_extreme_windows_are_right_and_not_only_finite() -> None:
    rows: list[Any] = exactness.exactness_table(quick=True).rows
    assert len(rows) == 7 and all(row[1] > 0 for row in rows)
    assert max(max(row[2 : 2 + len(LADDER)]) for row in rows) < 1e-5
    assert sum(row[-1] for row in rows) == 0


def test_the_table_of_exactness_sees_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """One in the reference shows at once, whichever family it is in."""
    monkeypatch.setattr(exactness, "LADDER", LADDER[-1:])
    monkeypatch.setattr(exactness, "by_reference", lambda data: lambda some: by_reference(data)(some)[:, ::-1])
    rows: list[Any] = exactness.exactness_table(quick=True).rows
    assert min(row[2] for row in rows) > 1e-3


def test_denormals_in_the_place_of_zeros_change_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(denormals, "ROUNDS", 1)
    monkeypatch.setattr(denormals, "LADDER", ("lstm", "touch_pattern_rf"))
    windows = [gestures()["swipe_up"], gestures()["one_tap"]]
    rows: list[Any] = denormals.denormals_table(windows).rows
    assert [row[0].split(",")[0] for row in rows] == ["lstm", "touch_pattern_rf", "front end", "front end"]
    assert all(row[5] < 1e-6 and row[6] == 0 for row in rows[:2])
    assert 0 < denormals.DENORMAL < np.finfo(np.float32).tiny
    assert shipped()["lstm"].exists()
