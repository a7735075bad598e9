"""Rules for deciding early, on worlds whose best moment is known."""

import numpy as np
import pytest

from gestured.lab.early import Asked
from gestured.lab.field import Contacts, calimera, probability_threshold

FRAMES, KNOWN = 12, 6  # from this frame on the scores say it; before they say nothing


def world(seed: int, count: int = 300) -> Contacts:
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 3, count)
    scores = np.full((count, FRAMES, 3), 1 / 3, np.float32) + rng.normal(0, 0.01, (count, FRAMES, 3)).astype(np.float32)
    scores[np.arange(count), KNOWN:, truth] += 0.6
    flat = scores.reshape(-1, 3) / scores.reshape(-1, 3).sum(1, keepdims=True)
    asked = Asked(
        np.repeat(np.arange(count), FRAMES), np.tile(np.arange(FRAMES) / 15, count), flat.argmax(1),
        flat.max(1).astype(np.float64), truth, np.arange(count),
    )  # fmt: skip
    return Contacts(asked, flat, truth)


def test_calimera_stops_when_it_knows_and_not_before() -> None:
    stops = calimera(world(1), world(2), 0.95)
    steps = world(2).step()[stops[stops >= 0]]
    assert (stops >= 0).mean() > 0.95
    assert np.median(steps) == KNOWN


def test_calimera_does_not_wait_where_waiting_costs_more_than_being_wrong() -> None:
    stops = calimera(world(1), world(2), 0.0)
    assert (world(2).step()[stops] == 0).all()


def test_a_threshold_stops_at_the_first_score_that_reaches_it() -> None:
    made = world(3)
    assert (made.step()[probability_threshold(made, 0.5)] == KNOWN).all()
    assert (probability_threshold(made, 0.99) == -1).all()


def test_what_stops_at_the_end_is_neither_early_nor_worse() -> None:
    made = world(4)
    end = made.judged(np.full(len(made.truth), -1, np.int64))
    assert (end["earliness"], end["accuracy"], end["harmonic_mean"]) == (1.0, 1.0, 0.0)
    early = made.judged(probability_threshold(made, 0.5))
    assert early["earliness"] == pytest.approx((KNOWN + 1) / FRAMES, abs=1e-3)
    assert early["accuracy"] == 1.0
