"""Everyday life as the simulator draws it: what nobody means is there, often enough, and where it can be."""

from functools import cache

import numpy as np
import pytest

from gestured.simulator.chance import CHANCE, NARROW_MM
from gestured.simulator.everyday import TAP_S, Happening, day, planned
from gestured.simulator.places import ANYWHERE, FINGERS, PLACES
from gestured.simulator.resting import HAND, NOBODY, POSTURES

LONG_S = 1800.0


@cache
def life(place: str, *, chance: bool = False) -> list[Happening]:
    """All that nobody means in half an hour of somebody at a place."""
    return planned(1, (CHANCE if chance else PLACES)[place], LONG_S).life


def test_all_that_may_happen_happens_somewhere_and_leaves_a_mark_that_a_sensor_can_take() -> None:
    made = [one for place in PLACES for _, one in life(place)]
    assert {one.kind for one in made} == {*ANYWHERE, *FINGERS, *POSTURES} - {NOBODY}
    by_chance = [one for place in CHANCE for _, one in life(place, chance=True)]
    assert {one.kind for one in by_chance} == {"anything", "lies"}
    for one in made + by_chance:
        assert one.contacts, one.kind
        for press in one.contacts:
            assert np.isfinite([press.x, press.y, press.force]).all() and np.diff(press.t).min() > 0, one.kind
            assert press.force.min() >= 0, one.kind
    assert all(max(press.force.max() for press in one.contacts) > 0 for one in made)


def test_there_are_contacts_enough_and_gestures_among_them() -> None:
    days = [day(seed, place, LONG_S / 6) for seed, place in enumerate(PLACES.values())]
    assert sum(one.contacts for one in days) / (len(days) / 12) >= 200
    assert sum(len(one.meant) for one in days) >= 5


@pytest.mark.parametrize("place", PLACES)
def test_a_free_finger_taps_only_where_nobody_lies_and_a_playing_one_only_where_a_hand_does(place: str) -> None:
    lying = [(at, at + one.duration_s, one.kind) for at, one in life(place) if one.kind in POSTURES]
    for at, one in life(place):
        under = {kind for a, b, kind in lying if a <= at < b}
        assert one.kind != "idle_tap" or not under
        assert not one.kind.startswith("playing_") or under == {HAND}


@pytest.mark.parametrize("place", CHANCE)
def test_chance_draws_no_tap(place: str) -> None:
    lone = [one for _, one in life(place, chance=True) if len(one.contacts) == 1]
    assert len(lone) > 20
    assert all(one.contacts[0].length >= NARROW_MM or one.duration_s > TAP_S for one in lone)
