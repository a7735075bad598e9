"""Unfinished gestures: what a network learns from is what the run time will ask it."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from gestured.core.frames import Segment
from gestured.lab.dataset import STREAMS, cuts
from gestured.lab.early import at_release
from gestured.lab.prefixes import askable, drawn, floors, prefixes, shortened
from gestured.lab.samples import WINDOW, Samples, collect, sample
from gestured.simulator import Participant, SimulatedSensor, generator, gesture_take


@pytest.fixture(scope="module")
def samples() -> Samples:
    return collect(s for i in range(60) for s in STREAMS["wide"](12, i))


def segment(kind: str, person: int) -> Segment:
    """What the front end cuts out of a gesture on the nominal sensor, which sends at the model's grid and rate."""
    take = gesture_take(kind, Participant(person), SimulatedSensor.nominal(day=person), generator(person, 8))
    (found,) = cuts(take.frames, take.times)
    return found


@pytest.mark.parametrize("kind", ["swipe_left", "circle_clockwise", "swipe_up_two_fingers", "palm"])
def test_a_prefix_is_what_the_window_makes_of_the_frames_so_far(kind: str) -> None:
    whole = segment(kind, 70)
    parts, of, since = prefixes(collect([sample(whole, kind, kind, 70)]))
    assert len(parts) >= 3
    assert not of.any()
    for k, frames in enumerate(since):
        end = whole.first + int(frames)
        so_far = replace_end(whole, end)
        np.testing.assert_allclose(parts.window(k), WINDOW.apply(so_far), atol=2e-3)


def replace_end(whole: Segment, end: int) -> Segment:
    return Segment(whole.frames[: end + 1], whole.times[: end + 1], whole.first, end, whole.noise)


def test_nothing_in_a_prefix_knows_what_follows(samples: Samples) -> None:
    half = (samples.last - samples.first) // 2
    frames = samples.frames.copy()
    for i in range(len(samples)):
        frames[samples.offsets[i] + samples.first[i] + half[i] + 1 : samples.offsets[i + 1]] = 30.0
    (parts, of, since), (others, of_other, later) = prefixes(samples), prefixes(replace(samples, frames=frames))
    early, again = np.flatnonzero(since <= half[of]), np.flatnonzero(later <= half[of_other])
    assert len(early) > len(samples) / 2
    for one, other in zip(early, again, strict=True):
        assert of[one] == of_other[other] and np.array_equal(parts.window(one), others.window(other))


def test_cutting_in_a_batch_is_cutting_alone(samples: Samples) -> None:
    from gestured.lab.fit import padded

    index = np.arange(20)
    asked = askable(samples)
    lengths = drawn(index, samples, asked, 1.0, np.random.default_rng(1))
    chosen = index[lengths > 0]
    assert len(chosen) > 10
    x = shortened(
        padded(samples, chosen, 80), torch.from_numpy(lengths[lengths > 0]), torch.from_numpy(floors(samples)[chosen])
    )
    parts, of, _ = prefixes(samples)
    for row, i in enumerate(chosen):
        (alone,) = [k for k in np.flatnonzero(of == i) if len(parts.window(int(k))) == lengths[i]]
        length = int(lengths[i])
        np.testing.assert_allclose(x[row, :length].numpy(), parts.window(int(alone)), atol=2e-3)
        assert not x[row, length:].any()


def test_every_length_is_drawn_and_the_rest_stay_whole(samples: Samples) -> None:
    rng, asked = np.random.default_rng(3), askable(samples)
    index = np.repeat(int(samples.lengths().argmax()), 4000)
    lengths = drawn(index, samples, asked, 0.25, rng)
    assert (lengths > 0).mean() == pytest.approx(0.25, abs=0.03)
    i = int(index[0])
    possible = np.flatnonzero(asked[samples.offsets[i] : samples.offsets[i + 1]])[1:] + 1
    assert set(lengths[lengths > 0].tolist()) == set(possible.tolist())


def test_at_its_first_release_a_double_tap_is_one_tap() -> None:
    whole = collect(
        [sample(segment("double_tap", person), "double_tap", "double_tap", person) for person in (71, 72, 73)]
    )
    first = at_release(whole)
    assert (first.lengths() < whole.lengths()).all()
    for i in range(len(first)):
        window = first.window(i)
        assert window.max() == pytest.approx(1.0, abs=1e-3)
        assert window[-1].max() < 0.15  # the finger has left
