"""The order of the trials: complete, a participant's own, the same again, and resumable anywhere."""

import argparse
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.lab.recordings.protocol import INCLINATION_NAMES, Exercise, left, order, pseudonym
from gestured.lab.recordings.store import join_recordings
from gestured.record.recordings import Recordings
from gestured.simulator import GESTURES, SPEEDS


def kept(trials: list[Exercise]) -> Recordings:
    n = len(trials)
    return Recordings(
        np.zeros((n, 2, 2)), np.zeros(n), np.arange(n + 1), np.array([t.gesture for t in trials]),
        np.array(["07"] * n), np.array([t.speed for t in trials]), np.array([t.inclination for t in trials]),
    )  # fmt: skip


@pytest.mark.parametrize("repeats", [1, 3])
def test_everything_is_performed_as_often_as_asked(repeats: int) -> None:
    trials = order("07", 0, GESTURES, repeats)
    expected = {Exercise(g, s, i) for g in GESTURES for s in SPEEDS for i in range(len(INCLINATION_NAMES))}
    assert Counter(trials) == dict.fromkeys(expected, repeats)


def test_the_sensor_is_moved_as_seldom_as_can_be() -> None:
    poses = [trial.inclination for trial in order("07", 0, GESTURES, 2)]
    assert sum(a != b for a, b in zip(poses, poses[1:], strict=False)) == len(INCLINATION_NAMES) - 1


def test_an_order_is_a_participants_own_and_the_same_again() -> None:
    orders = {tuple(order(name, seed, GESTURES, 1)) for name in ("07", "08", "7", "A") for seed in (0, 1)}
    assert len(orders) == 8
    assert order("07", 0, GESTURES, 1) == order("07", 0, GESTURES, 1)


@given(st.integers(1, 3), st.data())
def test_what_is_left_and_what_was_kept_are_the_whole(repeats: int, data: st.DataObject) -> None:
    trials = order("07", 0, GESTURES[:2], repeats)
    chosen = data.draw(st.sets(st.integers(0, len(trials) - 1)))
    done = [trials[k] for k in sorted(chosen)]
    rest = left(trials, kept(done))
    assert Counter(rest) + Counter(done) == Counter(trials)
    assert left(trials, None) == trials


def test_what_is_kept_beside_imported_recordings_is_not_asked_for_again() -> None:
    trials = order("07", 0, GESTURES[:2], 1)
    imported = replace(kept(trials[:1]), speeds=None, inclinations=None)
    assert left(trials, join_recordings([imported, kept(trials[:3])])) == trials[3:]


@pytest.mark.parametrize("name", ["07", "A", "a_b-C9", "x" * 32])
def test_pseudonyms(name: str) -> None:
    assert pseudonym(name) == name


@pytest.mark.parametrize("name", ["", "x" * 33, "Änne", "Anna Meier", "../07", "07.npz", "0\n7", "07\n"])
def test_what_is_no_pseudonym_is_refused_with_the_reason(name: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="A-Z a-z 0-9 _ -.*never a name"):
        pseudonym(name)
