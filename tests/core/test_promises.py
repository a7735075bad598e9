"""What the core promises as far as a figure goes: within it a promise holds, and beyond it something else does.

Packets go in and events come out, with a classifier that calls everything a swipe. Times are written down.
"""

from collections.abc import Iterable

import numpy as np
import pytest
from numpy.typing import NDArray

from gestured.core.events import Cancelled, Event, Gesture, Unknown
from gestured.core.facts import Dropped, Taken
from gestured.core.front_end import FrontEnd
from gestured.core.hub import Hub
from tests.core.test_conditioning import GAIN, SHAPE, Action, finger, quiet, stream, swipe
from tests.core.test_hub import FIRST, SCENE, SECOND, Sure
from tests.daemon.harness import floats

Array = NDArray[np.float64]

SWIPE = swipe(SHAPE, column=4)


def answers(times: Iterable[float], frames: Array) -> list[Event]:
    """What becomes of the contacts of a sensor that sends these frames, each alone."""
    hub, facts, t = Hub(SCENE, Sure()), list[object](), 0.0
    for t, frame in zip(times, frames, strict=True):
        facts += hub.receive([(floats("/arm/pressure", frame, 0), FIRST)], t)
    return [fact for fact in [*facts, *hub.flush(t + 2.0)] if isinstance(fact, Gesture | Unknown | Cancelled)]


def kinds(events: Iterable[Event]) -> list[str]:
    return [event.reason if isinstance(event, Cancelled | Unknown) else type(event).__name__ for event in events]


def bridged(events: Iterable[Event]) -> list[int]:
    """Of each gesture, how many bad taxels lay under its way."""
    return [event.where.bridged for event in events if isinstance(event, Gesture) and event.where]


@pytest.mark.parametrize(("pause", "expected"), [(0.9, ["hole"]), (1.1, ["silence", "hole"])])
def test_a_contact_goes_on_after_a_pause_of_less_than_a_second_and_is_over_after_a_longer_one(
    pause: float, expected: list[str]
) -> None:
    times, frames = stream(SHAPE, [quiet(2), SWIPE, quiet(1)])
    assert kinds(answers(times + pause * (times > 2.4), frames)) == expected


@pytest.mark.parametrize(("pause", "refused"), [(0.9, SECOND), (1.1, FIRST)])
def test_another_source_has_a_sensor_once_its_owner_was_silent_for_a_second(
    pause: float, refused: tuple[str, int]
) -> None:
    hub, packet, facts = Hub(SCENE, Sure()), floats("/arm/pressure", np.zeros(SHAPE), 0), list[object]()
    for now, source in ((5.0, FIRST), (5.0 + pause, SECOND), (5.01 + pause, FIRST)):
        facts += hub.receive([(packet, source)], now)
    dropped = [fact for fact in facts if isinstance(fact, Dropped)]
    assert [(fact.reason, fact.source) for fact in dropped] == [("second_source", refused)]


@pytest.mark.parametrize(("times_the_noise", "bad"), [(6.5, 0), (9.5, 1)])
def test_a_taxel_is_bridged_where_it_has_more_than_eight_times_the_sensors_noise(
    times_the_noise: float, bad: int
) -> None:
    times, frames = stream(SHAPE, [quiet(60), SWIPE, quiet(1)], noise=2.0)
    mean = 2.0 * times_the_noise * np.sqrt(2 / np.pi)  # counts, what such a taxel is off its baseline
    frames[:, 4, 4] += mean * np.random.default_rng(0).choice([-1, 1], len(times))
    assert bridged(answers(times, frames)) == [bad]


@pytest.mark.parametrize(("still", "expected"), [(1, [0, 0, 0]), (2, [0, 1, 0])])
def test_a_taxel_that_stands_still_under_two_gestures_is_stuck_and_under_one_it_may_be_chance(
    still: int, expected: list[int]
) -> None:
    times, frames = stream(SHAPE, [quiet(1), *[quiet(1), SWIPE] * 3, quiet(1)])
    for n in range(still):
        frames[(times > 1.9 + 1.8 * n) & (times < 2.9 + 1.8 * n), 4, 4] = 300.0
    assert bridged(answers(times, frames)) == expected


@pytest.mark.parametrize(("rows", "expected"), [(4, "Gesture"), (5, "stuck")])
def test_a_contact_is_none_where_more_than_half_of_the_taxels_jump(rows: int, expected: str) -> None:
    times, frames = stream(SHAPE, [quiet(4.5), quiet(2)])
    jumps = np.flatnonzero((times > 2) & (times < 4.5))[::2]
    frames[jumps, :rows] += GAIN
    assert kinds(answers(times, frames)) == [expected]


@pytest.mark.parametrize(("every", "expected"), [(7, ["held", "Gesture"]), (9, ["held"])])
def test_what_is_wider_than_fingers_twice_a_second_is_learned_like_an_arm(every: int, expected: list[str]) -> None:
    """An elbow lies there for three seconds before the swipe. If it was not learned, both are one contact."""
    elbow = np.zeros(SHAPE)
    elbow[3:6, 0:2] = elbow[4, 2] = GAIN / 4
    swiped: Action = (0.4, lambda share: finger(7 - 6 * share, 7, SHAPE) + elbow)
    times, frames = stream(SHAPE, [quiet(2), (3.0, lambda share: elbow), swiped, (1.0, lambda share: elbow)])
    edge = np.where(np.arange(len(times)) % every, 0.46, 0.54) * GAIN / 4  # below and above half of the highest taxel
    frames[:, [3, 5, 2, 6], [2, 2, 0, 0]] += np.where(times > 2, edge, 0.0)[:, None]
    assert kinds(answers(times, frames)) == expected


def test_a_swipe_just_after_a_thing_has_left_counts_though_the_bare_sensor_has_sunk_meanwhile() -> None:
    """The sensor sinks by a thirteenth of the activity that the thing had, while that lies there."""
    thing: Action = (28.0, lambda share: finger(4, 4, SHAPE, width=1.5) / 2)
    times, frames = stream(SHAPE, [quiet(2), thing, quiet(0.35), SWIPE, quiet(2)])
    frames -= np.interp(times, [10, 27], [0, 40])[:, None, None]
    assert kinds(answers(times, frames)) == ["held", "Gesture"]


def test_a_swipe_just_after_a_hand_has_left_counts_though_it_left_little_bare_from_the_start() -> None:
    """The hand covers eight rows of nine while the sensor is learned, leaves for half a second, and comes back."""
    hand = np.zeros(SHAPE)
    hand[1:] = GAIN / 5
    first, again = ((seconds, lambda share: hand) for seconds in (2.0, 4.0))
    times, frames = stream(SHAPE, [first, quiet(0.5), again, quiet(0.35), SWIPE, quiet(1.5)])
    assert kinds(answers(times, frames)) == ["Gesture"]


@pytest.mark.parametrize(("faster", "spacing"), [(6, 1 / 15), (9, 1 / 30)])
def test_another_rate_is_known_after_half_a_second_and_a_hurry_of_a_few_frames_is_none(
    faster: int, spacing: float
) -> None:
    """Frames that arrive together are spaced at the usual rate."""
    hub, packet = Hub(SCENE, Sure()), (floats("/arm/pressure", np.zeros(SHAPE), 0), FIRST)
    for t in np.cumsum([1 / 15] * 30 + [1 / 30] * faster).tolist():
        hub.receive([packet], t)
    found = [fact.frame.t for fact in hub.receive([packet] * 3, t + 0.5) if isinstance(fact, Taken)]
    assert np.diff(found) == pytest.approx(spacing)


def test_training_cuts_with_the_waits_of_a_daemon_that_was_told_nothing() -> None:
    assert FrontEnd(*SHAPE).timing == SCENE.timing
