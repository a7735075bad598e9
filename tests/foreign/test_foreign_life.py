"""The other generator's everyday life: one seed is one life, its truth lies on its frames, its rates are as told."""

from collections import Counter
from functools import cache
from typing import Any

import numpy as np
import pytest

from experiments.foreign import LEVELS
from experiments.foreign.hands import GESTURES
from experiments.foreign.life import HOW, PLACES, RATES, TAP_S, WHILE_LYING, Life, live, story

SHORT_S = 240.0


def _times(life: Life) -> list[tuple[str, str, float, float]]:
    return [(act.label, act.kind, act.onset, act.offset) for act in (*life.meant, *life.contacts, *life.taps)]


@pytest.mark.parametrize("level", LEVELS)
def test_the_same_seed_lives_the_same_life_and_another_seed_another(level: str) -> None:
    first, again, other = live(3, level, SHORT_S), live(3, level, SHORT_S), live(8, level, SHORT_S)
    assert np.array_equal(first.frames, again.frames) and np.array_equal(first.times, again.times)
    assert _times(first) == _times(again) != _times(other) and first.place == other.place


@pytest.mark.parametrize("seed", range(len(PLACES)))
def test_what_was_meant_after_quiet_is_seen_from_its_onset_to_its_offset(seed: int) -> None:
    life = live(seed, "nominal", 2 * SHORT_S)
    assert life.frames.shape == (len(life.times), 9, 9) and (np.diff(life.times) > 0).all()
    quiet = [act for act in life.meant if act.kind == "quiet"]
    assert quiet
    for act in quiet:
        before = life.frames[(life.times > act.onset - 3.0) & (life.times < act.onset - 0.2)].astype(np.float64)
        during = life.frames[(life.times > act.onset - 0.04) & (life.times < act.offset + 0.04)].astype(np.float64)
        idle = before.mean(axis=0)
        assert np.abs(before - idle).max() < 0.5 * (during - idle).max()


@cache
def lives() -> list[Any]:
    """What forty people did in half an hour each, without frames."""
    return [story(seed) for seed in range(40)]


def test_gestures_are_meant_one_after_the_other_in_all_four_circumstances_and_none_is_counted_as_a_tap() -> None:
    found = Counter(act.kind for life in lives() for act in life.meant)
    assert set(found) == set(HOW) and min(found.values()) >= 40
    assert {act.label for life in lives() for act in life.meant} == set(GESTURES)
    for life in lives():
        edges = [t for act in life.meant for t in (act.onset, act.offset)]
        assert edges == sorted(edges) and edges[-1] < life.length
        for tap in life.taps():
            assert tap.offset - tap.onset <= TAP_S
            assert not any(act.onset < tap.offset and tap.onset < act.offset for act in life.meant)


def test_each_kind_comes_as_often_as_the_table_says() -> None:
    hours = sum(life.length - 32.0 for life in lives()) / 3600  # less the first seconds and the last
    contacts = sum(len(life.contacts) for life in lives())
    assert 200 <= contacts / hours and 0 < sum(len(life.taps()) for life in lives()) <= contacts / 5
    done = Counter(act.kind for life in lives() for act in life.contacts)
    done["gesture"] = sum(len(life.meant) for life in lives())
    for kind in RATES.keys() - {*WHILE_LYING, "drum", "play", "pat"}:  # these are counted touch by touch
        expected = float(np.mean(RATES[kind][0])) * hours
        spread = np.sqrt(2 * expected + 0.3 * expected**2 / len(lives()))  # bouts, and people's habits
        assert abs(done[kind] - expected) < 4 * spread, (kind, done[kind], expected)
