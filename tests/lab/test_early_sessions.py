"""How early a model speaks: events of hours written down, with figures that can be counted by hand."""

from typing import Any

import pytest

from experiments.early import Ahead
from gestured.core.events import Cancelled, Event, Gesture, Onset, Provisional, Release, Unknown
from gestured.lab.dataset import Truth


def act(label: str, onset: float, offset: float) -> Truth:
    return Truth(label, label, 1, onset, offset)


def answer(number: int, gesture: str, span: tuple[float, float], said: str | None, wait: float = 0.2) -> Gesture:
    onset, offset = span
    more: dict[str, Any] = {"frames": 9, "lost": 0, "model": "m", "degraded": False, "scores": {}}
    return Gesture("s", number, gesture, 0.9, number, onset, offset, offset + wait, **more, provisional=said)


def unknown(number: int, onset: float, offset: float, said: str | None) -> Unknown:
    return Unknown("s", number, 0.2, onset, offset, offset + 0.2, 9, 0, "m", False, {}, provisional=said)


def early(number: int, gesture: str, onset: float, decided: float) -> Provisional:
    return Provisional("s", number, gesture, 0.95, onset, decided)


def counted(acts: list[Truth], events: list[Event], minutes: float = 1.0) -> dict[str, Any]:
    ahead = Ahead()
    ahead.add(events, acts, minutes)
    return ahead.figures()


def test_a_right_word_before_the_end_counts_as_early() -> None:
    found = counted(
        [act("swipe_left", 1.0, 1.6)],
        [Onset("s", 1, 1.0), early(1, "swipe_left", 1.0, 1.3), answer(1, "swipe_left", (1.0, 1.6), "confirmed")],
    )
    assert (found["early"], found["confirmed"], found["right"]) == (1.0, 1.0, 1.0)
    assert found["moved_median_s"] == pytest.approx(-0.3)


@pytest.mark.parametrize(
    ("events", "early_share", "confirmed", "after"),
    [
        ([answer(1, "swipe_left", (1.0, 1.6), None)], 0.0, None, 0.2),  # nothing was said
        ([early(1, "swipe_left", 1.0, 1.7), answer(1, "swipe_left", (1.0, 1.6), "confirmed")], 0.0, 1.0, 0.1),  # late
        ([early(1, "swipe_up", 1.0, 1.3), answer(1, "swipe_left", (1.0, 1.6), "revoked")], 0.0, 0.0, 0.2),  # wrong
        ([early(1, "swipe_left", 1.0, 1.3), unknown(1, 1.0, 1.6, "revoked")], 1.0, 0.0, -0.3),  # right, yet revoked
        ([early(1, "swipe_up", 1.0, 1.3), Cancelled("s", 1, "held", "revoked"), Release("s", 1, 1.6)], 0.0, 0.0, None),
    ],
)
def test_what_is_not_both_right_and_early_is_not_counted_as_that(
    events: list[Event], early_share: float, confirmed: float | None, after: float | None
) -> None:
    found = counted([act("swipe_left", 1.0, 1.6)], events)
    assert (found["early"], found["confirmed"]) == (early_share, confirmed)
    assert found["moved_median_s"] == (None if after is None else pytest.approx(after))


def test_taps_have_figures_of_their_own() -> None:
    found = counted(
        [act("one_tap", 1.0, 1.1), act("double_tap", 5.0, 5.5)],
        [
            early(1, "one_tap", 1.0, 1.23), answer(1, "one_tap", (1.0, 1.1), "confirmed", 0.6),
            early(2, "one_tap", 5.0, 5.2), answer(2, "double_tap", (5.0, 5.5), "revoked"),
        ],
    )  # fmt: skip
    assert (found["moved"], found["early"], found["events"]) == (0, None, 0)
    assert (found["taps"], found["taps_confirmed"]) == (2, 0.5)
    assert found["tap_median_s"] == pytest.approx(0.13)
    assert found["right"] == 1.0


def test_nothing_but_other_things_gives_events_a_minute() -> None:
    found = counted([act("none", 1.0, 3.0)], [early(1, "swipe_up", 1.0, 1.5), unknown(1, 1.0, 3.0, "revoked")], 2.0)
    assert (found["gestures"], found["events_per_minute"], found["confirmed"]) == (0, 0.5, 0.0)
