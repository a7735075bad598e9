"""Sessions bent as no laboratory would: what a clock, a slow warmth or a counter does changes no decision."""

from dataclasses import replace

import numpy as np
import pytest

from gestured.lab.stability.stiff import Case, cases, day_table, stiff_table
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER

HARMLESS = (
    "warms: 1 noise",
    "arm on the edge that creeps",
    "a clock of 10 ms",
    "steps by 3600 s",
    "counter that wraps",
)


def test_harmless_cases_lose_no_more_than_a_gesture_or_two(monkeypatch: pytest.MonkeyPatch) -> None:
    usual, *others = cases()
    chosen = [usual, *(case for case in others if any(part in case.title for part in HARMLESS))]
    assert len(chosen) == 1 + len(HARMLESS)
    # And one of which everybody must see that it harms, or the table would say nothing.
    chosen.append(Case("blind", lambda take, _: replace(take, frames=np.zeros(take.frames.shape))))
    monkeypatch.setattr("gestured.lab.stability.stiff.cases", lambda: chosen)
    monkeypatch.setattr("gestured.lab.stability.stiff.SESSION_S", 60.0)
    table = stiff_table(open_model(LADDER[0]), quick=True)
    (_, _, meant, right, *_), *bent, blind, day = table.rows
    assert isinstance(right, int) and isinstance(meant, int) and right >= 0.9 * meant
    for title, _, asked, found, _, _, false, _ in bent:
        assert asked == meant and isinstance(found, int) and found >= right - 2 and false == 0, title
    assert blind[3] == 0
    assert day[2] == 2 and day[3] in (1, 2) and day[6] == 0


def test_the_same_hours_leave_the_same_behind() -> None:
    """What a front end holds does not grow."""
    (_, frames, after, most, digest), (_, *again) = day_table(quick=True).rows
    assert [frames, after, most, digest] == again
    assert isinstance(after, int) and isinstance(most, int) and 8 * 81 * 5 < after <= most < 50_000
