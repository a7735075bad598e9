"""Sets put together lose nothing; what the front end marks is where it was touched."""

from dataclasses import replace

import numpy as np
import pytest

from gestured.core.errors import RecordingError
from gestured.lab.recordings.store import compact, join_recordings, touched
from gestured.record.check import check
from gestured.simulator import GESTURES, Participant, SimulatedSensor, generator, gesture_take
from tests.small_recording import example, same, session


@pytest.mark.parametrize(("one", "other"), [(example(), example()), (session(), session()), (example(), session())])
def test_what_was_joined_can_be_taken_apart(one, other) -> None:
    together = join_recordings([one, other])
    check(together)
    same(replace(together.take([0, 1]), **empty_events(one)), one)
    same(together.take([2, 3]), other)


def empty_events(of) -> dict[str, None]:
    names = ("event_recording", "event_labels", "event_kinds", "event_onsets", "event_offsets")
    return dict.fromkeys(names) if of.event_labels is None else {}


def test_what_one_set_does_not_know_is_empty_there() -> None:
    bare = replace(
        example(), speeds=None, consents=None, touches=None, touch_ids=None, onsets=None, subjects=np.array(["a", "b"])
    )
    together = join_recordings([bare, example()])
    check(together)
    assert together.speeds is not None and together.consents is not None and together.touches is not None
    assert together.speeds.tolist() == ["", "", "fast", "slow"]
    assert together.consents.tolist() == ["", "", "2026-01-31", ""]
    assert together.subjects.tolist() == ["a", "b", "3", "4"]
    assert np.isnan(together.touches[:10]).all()
    assert together.onsets is None  # a frame cannot be made up
    assert together.releases is not None


def test_two_grids_are_refused() -> None:
    with pytest.raises(RecordingError, match="one grid, found 2x3 and 3x3"):
        join_recordings([example(), replace(example(), frames=np.zeros((10, 3, 3)))])


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([0, 65535], np.uint16),
        ([-1, 70000], np.int32),
        ([0.5, 1], np.float32),
        ([0, 2**40], np.float32),
        ([1e300, 0.5], np.float64),
    ],
)
def test_counts_are_kept_exactly_in_the_smallest_type(values: list[float], kind: type) -> None:
    frames = np.array(values, np.float64).reshape(-1, 1, 1)
    found = compact(frames)
    assert found.dtype == kind
    np.testing.assert_array_equal(found, frames)


@pytest.mark.parametrize("gesture", GESTURES)
@pytest.mark.parametrize("cut", [False, True], ids=["with idle frames", "cut close"])
def test_the_touched_frames_are_found(gesture: str, cut: bool) -> None:
    made = gesture_take(gesture, Participant(901), SimulatedSensor.nominal(day=901), generator(1, 1), "normal", 1)
    event = made.events[0]
    onset, release = np.searchsorted(made.times, [event.onset_s, event.offset_s])
    start = onset - 2 if cut else 0
    found = touched(made.frames[start:], made.times[start:])
    assert found is not None
    assert abs(found[0] + start - onset) <= 2
    assert abs(found[1] + start - release) <= 2


def test_nothing_touched_is_nothing() -> None:
    rng = np.random.default_rng(0)
    assert touched(100 + rng.normal(0, 1, (60, 9, 9)), np.arange(60) / 15) is None
