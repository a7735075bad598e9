"""Thresholds for provisional events: what they promise holds on people who were not learned from."""

from typing import Any

import numpy as np
import pytest

from gestured.lab.early import CONFIRMED, STRETCHES, Asked, calibrated, chance_of, given

GESTURES = ("swipe_up", "swipe_down")
NONE = -1


def events(asked: Asked, provisional: dict[str, Any], gestures: tuple[str, ...]) -> np.ndarray:
    """(G,) the question at which each contact's provisional event is given, -1 for none: one frame is enough."""
    rows = [provisional["gestures"].get(name, provisional["thresholds"]) for name in gestures]
    level = np.array([[np.inf if value is None else value for value in row] for row in rows])
    found = np.full(len(asked.answer), -1, np.int64)
    first = given(asked.confidence >= level[asked.best, asked.stretch], asked.contact)
    found[asked.contact[first]] = first
    return found


def world(seed: int, contacts: int = 4000, *, honest: bool = True, people: int | None = None) -> Asked:
    """Contacts of which the truth is known: a stated confidence c is right with probability c (or not `honest`: c^4).

    Every contact is asked at 15 frames, its confidence grows with time.
    """
    rng = np.random.default_rng(seed)
    frames = 15
    chance = 1 - rng.random(contacts) ** 3 * 0.6  # how sure the model ends
    kept = rng.random(contacts) < (chance if honest else chance**4)
    best = rng.integers(0, 2, contacts)
    grown = np.minimum(np.arange(1, frames + 1) / 6, 1.0)
    return Asked(
        np.repeat(np.arange(contacts), frames),
        np.tile(np.arange(frames) / 15, contacts),
        np.repeat(best, frames),
        (chance[:, None] * grown).ravel(),
        np.where(kept, best, NONE),
        np.arange(contacts) if people is None else np.arange(contacts) % people,
    )


def share_confirmed(asked: Asked, at: np.ndarray) -> tuple[float, int]:
    given = np.flatnonzero(at >= 0)
    return float((asked.best[at[given]] == asked.answer[given]).mean()), len(given)


@pytest.mark.parametrize("honest", [True, False])
def test_enough_of_the_events_is_confirmed_on_other_people(honest: bool) -> None:
    held = []
    for seed in range(8):
        found = calibrated(world(seed, honest=honest), GESTURES, None)
        other = world(1000 + seed, 8_000, honest=honest)
        share, given = share_confirmed(other, events(other, found, GESTURES))
        held.append(share >= CONFIRMED - 0.005)
        assert given > 0
    assert np.mean(held) >= 0.75  # the doubt that was allowed


def test_nearly_all_that_may_be_given_is_given() -> None:
    asked = world(1, 20_000)
    found = calibrated(asked, GESTURES, None)
    share, given = share_confirmed(asked, events(asked, found, GESTURES))
    best = 1 - np.sort(1 - asked.confidence[14::15])
    possible = int((np.cumsum(best) / np.arange(1, len(best) + 1) >= CONFIRMED).sum())
    assert given >= 0.6 * possible
    assert share < 0.995  # not safer than was asked for


def test_a_model_that_is_always_wrong_gives_nothing() -> None:
    asked = world(2)
    wrong = Asked(asked.contact, asked.elapsed_s, asked.best, asked.confidence, asked.answer * 0 + NONE, asked.person)
    found = calibrated(wrong, GESTURES, None)
    assert set(found["thresholds"]) == {None}
    assert (events(wrong, found, GESTURES) == -1).all()


def test_few_people_are_no_proof_however_often_they_move() -> None:
    assert chance_of(np.arange(200), np.zeros(200, bool)) == pytest.approx(0.97**200)
    assert chance_of(np.arange(200) % 10, np.zeros(200, bool)) == pytest.approx(0.97**10)
    found = calibrated(world(3, people=10), GESTURES, None)
    assert set(found["thresholds"]) == {None}


def test_a_gesture_that_deceives_has_a_row_of_its_own() -> None:
    asked = world(4, 12_000)
    deceived = np.where(asked.best[::15] == 1, NONE, asked.best[::15])
    odd = Asked(asked.contact, asked.elapsed_s, asked.best, asked.confidence, deceived, asked.person)
    found = calibrated(odd, GESTURES, None)
    given = events(odd, found, GESTURES)
    assert (odd.best[given[given >= 0]] == 0).all()
    assert (given >= 0).sum() > 1000


def test_the_first_frame_that_is_sure_enough_of_its_gesture_gives_the_event() -> None:
    asked = Asked(
        np.array([0, 0, 0, 1, 1, 1]), np.array([0, 0.067, 0.133] * 2), np.array([0, 1, 1, 0, 0, 1]),
        np.array([0.4, 0.9, 0.8, 0.7, 0.6, 0.99]), np.array([1, 0]), np.arange(2),
    )  # fmt: skip
    rule = {"elapsed_s": list(STRETCHES), "thresholds": [0.5] * len(STRETCHES), "gestures": {}}
    assert events(asked, rule, GESTURES).tolist() == [1, 3]
    assert events(asked, {**rule, "gestures": {"swipe_up": [None] * len(STRETCHES)}}, GESTURES).tolist() == [1, 5]
