"""Why a model that went on is not written: what it is worth before and after, on own recordings and simulated ones."""

from typing import Any

import pytest

from gestured.lab.adapt.adaptation import Adapted, Shares

NOTHING: Any = None  # what no reason looks at


def shares(right: float, wrong: float = 0.02, accepted: float = 0.04, others: int = 100) -> Shares:
    """Shares whose intervals are not asked for."""
    values = (right, wrong, 1 - right - wrong, accepted)
    return Shares(100, others, *((value, value, value) for value in values))


def reasons(own: Shares, simulated: Shares) -> list[str]:
    """Of a model that was 0.80 right here, and 0.95 right on simulated takes."""
    both = shares(0.80), own, shares(0.95), simulated
    return Adapted(NOTHING, 0.5, *both, 1.0, NOTHING, NOTHING, {}).reasons()


def test_what_is_better_here_and_no_worse_there_is_written() -> None:
    assert reasons(shares(0.85), shares(0.945, accepted=0.045)) == []


@pytest.mark.parametrize(
    ("own", "simulated", "words"),
    [
        (shares(0.80), shares(0.95), "right does not go up (0.800 -> 0.800)"),
        (shares(0.85, wrong=0.03), shares(0.95), "wrong goes up (0.020 -> 0.030)"),
        (shares(0.85), shares(0.92), "3.0 points of the simulated gestures are lost"),
        (shares(0.85), shares(0.95, accepted=0.11), "7.0 points more of the simulated non-gestures are accepted"),
    ],
)
def test_what_is_worse_is_said(own: Shares, simulated: Shares, words: str) -> None:
    (reason,) = reasons(own, simulated)
    assert reason.startswith(words)


def test_who_recorded_no_non_gestures_is_told_to() -> None:
    worse = shares(0.95, accepted=0.11)
    (reason,) = reasons(shares(0.85, others=0), worse)
    assert "record non-gestures of your own" in reason
    (reason,) = reasons(shares(0.85), worse)
    assert "record" not in reason
