"""Runs of a model that take too long are ended where somebody waits for answers, and no others."""

from contextlib import ExitStack
from types import SimpleNamespace

import pytest

from gestured.model import limit


@pytest.fixture(autouse=True)
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limit, "_hurried", False)
    limit.hurry()


@pytest.mark.parametrize("awake_s", [limit.AWAKE_S, 0.0], ids=["awake", "asleep"])
def test_each_run_is_ended_when_its_own_time_is_over(monkeypatch: pytest.MonkeyPatch, awake_s: float) -> None:
    monkeypatch.setattr(limit, "AWAKE_S", awake_s)
    for _ in range(3):  # the thread looks seldom, and is asleep without any run: who comes later wakes it where need be
        limits = [60.0, 0.03, 30.0, 0.01, 0.02]
        runs = [SimpleNamespace(terminate=False) for _ in limits]
        with ExitStack() as stack:
            for run, seconds in zip(runs, limits, strict=True):
                stack.enter_context(limit.limited(run, seconds))
            while not all(run.terminate for run, seconds in zip(runs, limits, strict=True) if seconds < 1):
                pass
            assert [run.terminate for run in runs] == [seconds < 1 for seconds in limits]


def test_a_run_that_was_over_in_time_is_not_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    over, late = (SimpleNamespace(terminate=False) for _ in range(2))
    with limit.limited(over, 0.5):
        pass
    with limit.limited(late, 0.6):
        while not late.terminate:
            pass
    assert not over.terminate


def test_where_nobody_waits_for_answers_no_run_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the laboratory a busy machine would change figures, and end what has taken hours."""
    monkeypatch.setattr(limit, "_hurried", False)
    run, late = (SimpleNamespace(terminate=False) for _ in range(2))
    with limit.limited(run, 0.0):
        limit.hurry()
        with limit.limited(late, 0.01):  # its end shows that whoever ends runs has looked
            while not late.terminate:
                pass
        assert not run.terminate
