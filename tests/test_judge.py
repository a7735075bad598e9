"""What was performed beside what was recognised."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.record.judge import LEAST, MISSED_AFTER_S, NONE, Performed, Tally, owners, whose


def gesture(name: str, onset: float, offset: float) -> dict[str, object]:
    return {"type": "gesture", "gesture": name, "onset": onset, "offset": offset}


def test_right_with_its_latency():
    tally = Tally()
    tally.begin(Performed("one_tap", "one_tap", 10.0, 10.2))
    outcome = tally.hear(gesture("one_tap", 10.05, 10.15), arrived=10.5)
    assert outcome.verdict == "right"
    assert outcome.latency_s == pytest.approx(0.3)
    assert tally.settle(math.inf) == []


def test_another_gesture_is_wrong():
    tally = Tally()
    tally.begin(Performed("one_tap", "one_tap", 10.0, 10.2))
    assert tally.hear(gesture("swipe_up", 10.0, 10.2), 10.4).verdict == "wrong"


def test_a_gesture_is_missed_only_when_nothing_can_come_any_more():
    tally = Tally()
    tally.begin(Performed("one_tap", "one_tap", 10.0, 10.2))
    assert tally.settle(10.2 + MISSED_AFTER_S - 0.01) == []
    (outcome,) = tally.settle(10.2 + MISSED_AFTER_S)
    assert outcome.verdict == "missed"
    assert tally.settle(math.inf) == []


def test_an_unknown_may_still_be_followed_by_the_gesture():
    tally = Tally()
    performed = Performed("double_tap", "double_tap", 10.0, 11.0)
    tally.begin(performed)
    assert tally.hear({"type": "unknown", "onset": 10.0, "offset": 10.2}, 10.3) is None
    assert performed.unknown
    assert tally.hear(gesture("double_tap", 10.6, 11.0), 11.3).verdict == "right"


def test_no_gesture_is_rejected_or_a_false_event():
    tally = Tally()
    tally.begin(Performed(NONE, "palm", 10.0, 11.0))
    tally.begin(Performed(NONE, "scribble", 20.0, 21.0))
    assert tally.hear(gesture("one_tap", 10.1, 10.9), 11.2).verdict == "false"
    assert [outcome.verdict for outcome in tally.settle(math.inf)] == ["rejected"]


def test_a_second_event_for_one_gesture_is_false():
    tally = Tally()
    tally.begin(Performed("double_tap", "double_tap", 10.0, 10.6))
    assert tally.hear(gesture("double_tap", 10.0, 10.6), 10.9).verdict == "right"
    assert tally.hear(gesture("one_tap", 10.5, 10.6), 11.0).verdict == "false"


def test_an_event_out_of_nothing_is_false_and_hides_nothing():
    tally = Tally()
    tally.begin(Performed("one_tap", "one_tap", 10.0, 10.2))
    assert tally.hear(gesture("one_tap", 12.0, 12.2), 12.5).verdict == "false"
    assert [outcome.verdict for outcome in tally.settle(math.inf)] == ["missed"]


def test_of_two_neighbours_the_one_that_overlaps_more():
    tally = Tally()
    first, second = Performed("one_tap", "one_tap", 10.0, 10.2), Performed("swipe_up", "swipe_up", 10.5, 11.0)
    tally.begin(first)
    tally.begin(second)
    assert tally.hear(gesture("swipe_up", 10.35, 11.0), 11.2).performed is second


spans = st.tuples(st.floats(0, 60), st.floats(0, 3)).map(lambda span: (span[0], span[0] + span[1]))
labels = st.sampled_from(["one_tap", "swipe_up", NONE])


@given(st.lists(st.tuples(labels, spans)), st.lists(st.tuples(st.sampled_from(["one_tap", "swipe_up"]), spans)))
def test_everything_is_counted_once(performances, events):
    tally = Tally()
    for label, (onset, offset) in performances:
        tally.begin(Performed(label, label, onset, offset))
    for name, (onset, offset) in events:
        tally.hear(gesture(name, onset, offset), offset + 0.2)
    tally.settle(math.inf)
    counts = tally.counts
    gestures = sum(label != NONE for label, _ in performances)
    assert counts["right"] + counts["wrong"] + counts["missed"] == gestures
    assert counts["right"] + counts["wrong"] + counts["false"] == len(events)
    assert counts["rejected"] <= len(performances) - gestures
    assert len(tally.latencies) == counts["right"] + counts["wrong"]


@given(st.lists(st.tuples(labels, spans)), st.lists(spans))
def test_many_belong_to_whom_each_of_them_belongs(performances, said):
    acts = sorted((Performed(label, label, *span) for label, span in performances), key=lambda act: act.onset)
    expected = [id(whose(onset, offset, acts)) for onset, offset in said]
    assert [id(found) for found in owners(said, acts)] == expected


def test_what_was_said_early_is_counted_with_its_lead():
    tally = Tally()
    for name, verdict, decided in (("one_tap", "confirmed", 10.1), ("swipe_up", "revoked", 20.1)):
        tally.begin(Performed(name, name, decided - 0.1, decided + 0.2))
        early = {"type": "provisional", "gesture": "one_tap", "decided": decided}
        assert tally.hear(early, decided) is None
        found = gesture(name, decided - 0.1, decided + 0.15) | {"provisional": verdict}
        assert tally.hear(found, decided + 0.4).early is early
    tally.begin(Performed("one_tap", "one_tap", 30.0, 30.2))
    assert tally.hear(gesture("one_tap", 30.0, 30.2) | {"provisional": None}, 30.4).early is None
    assert {"provisional": 2, "confirmed": 1, "lead_ms_median": 150}.items() <= tally.summary().items()


@pytest.mark.parametrize(("gestures", "told"), [(LEAST - 1, False), (LEAST, True)])
def test_percentiles_are_of_twenty_gestures_or_more(gestures: int, told: bool):
    tally = Tally()
    for n in range(gestures):
        tally.begin(Performed("one_tap", "one_tap", 10.0 * n, 10.0 * n + 0.1))
        event = {"type": "gesture", "gesture": "one_tap", "onset": 10.0 * n, "offset": 10.0 * n + 0.1}
        tally.hear(event, 10.0 * n + 0.3)
        tally.settle(10.0 * n + 5)
    summary = tally.summary()
    assert summary["right"] == gestures
    assert (summary["latency_ms_median"] is not None) == (summary["latency_ms_p95"] is not None) == told
