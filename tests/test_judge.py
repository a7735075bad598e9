"""What was performed beside what was recognised."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.record.judge import LEAST, MISSED_AFTER_S, NONE, UNNAMED, Performed, Tally, owners, tallied, whose


def said(name: str, onset: float, offset: float) -> dict[str, object]:
    """The event of a gesture, or `unknown`."""
    return {"type": "unknown" if name == "unknown" else "gesture", "gesture": name, "onset": onset, "offset": offset}


@pytest.mark.parametrize(
    ("performed", "heard", "verdicts", "left"),
    [
        ([("one_tap", 10.0, 10.2)], [("one_tap", 10.05, 10.15)], ["right"], []),
        ([("one_tap", 10.0, 10.2)], [("swipe_up", 10.0, 10.2)], ["wrong"], []),
        ([("double_tap", 10.0, 11.0)], [("unknown", 10.0, 10.2), ("double_tap", 10.6, 11.0)], [None, "right"], []),
        ([("double_tap", 10.0, 10.6)], [("double_tap", 10.0, 10.6), ("one_tap", 10.5, 10.6)], ["right", "false"], []),
        ([("one_tap", 10.0, 10.2)], [("one_tap", 12.0, 12.2)], ["false"], ["missed"]),
        ([(NONE, 10.0, 11.0), (NONE, 20.0, 21.0)], [("one_tap", 10.1, 10.9)], ["false"], ["rejected"]),
    ],
    ids=["right", "wrong", "an unknown before it", "two for one", "out of nothing", "no gesture"],
)
def test_what_was_said_is_judged_by_what_was_performed(performed, heard, verdicts, left):
    tally, acts = Tally(), [Performed(label, label, onset, offset) for label, onset, offset in performed]
    for act in acts:
        tally.begin(act)
    outcomes = [tally.hear(said(*one), one[2] + 0.3) for one in heard]
    assert [outcome and outcome.verdict for outcome in outcomes] == verdicts
    assert any(act.unknown for act in acts) == (None in verdicts)
    assert [outcome.verdict for outcome in tally.settle(math.inf)] == left


def test_a_gesture_is_missed_only_when_nothing_can_come_any_more():
    tally = Tally()
    tally.begin(Performed("one_tap", "one_tap", 10.0, 10.2))
    assert tally.settle(10.2 + MISSED_AFTER_S - 0.01) == []
    assert [outcome.verdict for outcome in tally.settle(10.2 + MISSED_AFTER_S)] == ["missed"]
    assert tally.settle(math.inf) == []


def test_of_two_neighbours_the_one_that_overlaps_more():
    tally = Tally()
    first, second = Performed("one_tap", "one_tap", 10.0, 10.2), Performed("swipe_up", "swipe_up", 10.5, 11.0)
    tally.begin(first)
    tally.begin(second)
    assert tally.hear(said("swipe_up", 10.35, 11.0), 11.2).performed is second


def test_what_nobody_named_takes_no_event_from_a_gesture_that_it_overlaps():
    """A finger rests where its swipe ended: one contact, of which only the swipe has a name."""
    swipe, rest = Performed("swipe_up", "", 10.0, 10.3), Performed(UNNAMED, "", 10.4, 11.4)
    assert whose(10.0, 11.4, [swipe, rest]) is swipe
    assert whose(10.4, 11.4, [swipe, rest]) is rest  # though it lies within the tolerance of the swipe


# Times on a grid, so that many overlap as much as another, and many lie exactly as far away as is allowed.
times = st.integers(0, 60).map(lambda n: n / 10)
spans = st.tuples(times | st.floats(0, 60), times | st.floats(0, 3)).map(lambda span: (span[0], span[0] + span[1]))
labels = st.sampled_from(["one_tap", "swipe_up", NONE])


@given(st.lists(st.tuples(labels, spans)), st.lists(st.tuples(st.sampled_from(["one_tap", "swipe_up"]), spans)))
def test_everything_is_counted_once(performances, events):
    tally = Tally()
    for label, (onset, offset) in performances:
        tally.begin(Performed(label, label, onset, offset))
    for name, (onset, offset) in events:
        tally.hear(said(name, onset, offset), offset + 0.2)
    tally.settle(math.inf)
    counts = tally.counts
    gestures = sum(label != NONE for label, _ in performances)
    assert counts["right"] + counts["wrong"] + counts["missed"] == gestures
    assert counts["right"] + counts["wrong"] + counts["false"] == len(events)
    assert counts["rejected"] <= len(performances) - gestures
    assert len(tally.latencies) == counts["right"] + counts["wrong"]


@given(st.lists(st.tuples(labels | st.just(UNNAMED), spans)), st.lists(spans))
def test_many_belong_to_whom_each_of_them_belongs(performances, heard):
    acts = [Performed(label, label, *span) for label, span in performances]
    expected = [id(whose(onset, offset, acts)) for onset, offset in heard]
    assert [id(found) for found in owners(heard, acts)] == expected


@given(st.lists(st.tuples(labels, spans)), st.lists(st.tuples(st.sampled_from(["one_tap", "unknown"]), spans)))
def test_a_whole_recording_is_judged_as_event_by_event(performances, events):
    def acts():
        return [Performed(label, str(n), *span) for n, (label, span) in enumerate(performances)]

    def told(outcomes):
        return [(one.verdict, one.performed and vars(one.performed), one.event, one.latency_s) for one in outcomes]

    heard = [said(name, *span) | {"decided": span[1] + 0.3} for name, span in events]
    slow = Tally(acts())
    expected = [outcome for event in heard if (outcome := slow.hear(event, event["decided"]))] + slow.settle(math.inf)
    tally, outcomes = tallied(acts(), heard)
    assert told(outcomes) == told(expected)
    assert tally == slow


def test_what_was_said_early_is_counted_with_its_lead():
    tally = Tally()
    for name, verdict, decided in (("one_tap", "confirmed", 10.1), ("swipe_up", "revoked", 20.1)):
        tally.begin(Performed(name, name, decided - 0.1, decided + 0.2))
        early = {"type": "provisional", "gesture": "one_tap", "decided": decided}
        assert tally.hear(early, decided) is None
        found = said(name, decided - 0.1, decided + 0.15) | {"provisional": verdict}
        assert tally.hear(found, decided + 0.4).early is early
    tally.begin(Performed("one_tap", "one_tap", 30.0, 30.2))
    assert tally.hear(said("one_tap", 30.0, 30.2) | {"provisional": None}, 30.4).early is None
    assert {"provisional": 2, "confirmed": 1, "lead_ms_median": 150}.items() <= tally.summary().items()


@pytest.mark.parametrize(("gestures", "told"), [(LEAST - 1, False), (LEAST, True)])
def test_percentiles_are_of_twenty_gestures_or_more(gestures: int, told: bool):
    tally = Tally()
    for n in range(gestures):
        tally.begin(Performed("one_tap", "one_tap", 10.0 * n, 10.0 * n + 0.1))
        tally.hear(said("one_tap", 10.0 * n, 10.0 * n + 0.1), 10.0 * n + 0.3)
        tally.settle(10.0 * n + 5)
    summary = tally.summary()
    assert summary["right"] == gestures
    latency_ms = 200 if told else None  # from the end of what was performed to the event's arrival
    assert (summary["latency_ms_median"], summary["latency_ms_p95"]) == (latency_ms, latency_ms)
