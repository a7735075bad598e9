"""Provisional events: what is said of a contact before its answer, and that no answer depends on it."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gestured.core.classifier import Match, Scores
from gestured.core.errors import ModelError
from gestured.core.events import Cancelled, Event, Gesture, Onset, Provisional, Unknown
from gestured.core.facts import Fault, events_of
from gestured.core.frames import Frame, Segment
from gestured.core.hub import Hub
from gestured.core.points import Certainty, Point
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.model.ladder import RETRY_S, SLOW_RUNS, Ladder
from gestured.model.model import Model
from tests.core.test_sensor import recognizer as answering
from tests.core.test_sensor import run
from tests.daemon.harness import Hand, floats
from tests.hostile.grammar import violations
from tests.scenario import frames
from tests.small_model import Clock

GESTURES = ("one_tap", "double_tap", "left", "right")
CERTAINTY = Certainty(2, (0.0, 0.2), (0.9, 0.8), tap=0.7)
TAP = "press 4,4 0.8 for 130ms"
SWIPE = "move 4,1 to 4,7 0.8 in 600ms"
IDLE, PAUSE, SHORT = "quiet for 1500ms", "quiet for 900ms", "quiet for 150ms"


def says(gesture: str, confidence: float = 0.95) -> Scores:
    rest = (1.0 - confidence) / (len(GESTURES) - 1)
    return Scores(np.array([confidence if g == gesture else rest for g in GESTURES], np.float32), 0.0, "seer")


@dataclass
class Seer:
    """Says of a whole segment `answer`, of a beginning what `early` says of it; an exception is raised, or is None."""

    answer: Callable[[Segment], Scores | Exception] = lambda segment: says("left")
    early: Callable[[Segment], Scores | Exception] = lambda segment: says("left")
    certainty: Certainty | None = CERTAINTY
    gestures: tuple[str, ...] = GESTURES
    asked: int = 0
    looked: list[Segment] = field(default_factory=list)

    def classify(self, segment: Segment) -> Scores:
        self.asked += 1
        found = self.answer(segment)
        if isinstance(found, Exception):
            raise found
        return found

    def preview(self, segment: Segment) -> Scores | None:
        self.looked.append(segment)
        found = self.early(segment)
        return None if isinstance(found, Exception) else found


def touching(seer: Seer) -> list[Segment]:
    """What it was shown while the finger was down."""
    return [segment for segment in seer.looked if segment.offset == segment.times[-1]]


def recognizer(seer: Any, *, asked: bool = True, taps: bool = True, **more: Any) -> Sensor:
    subject = answering(seer, provisional_taps=taps, **more)
    subject.foresee(asked=asked)
    return subject


def names(events: Sequence[Event]) -> list[str]:
    """Each event in a word: its gesture, or what it is; and what became of what was said before."""
    words = []
    for event in events:
        word = getattr(event, "gesture", type(event).__name__.lower())
        early = "?" if isinstance(event, Provisional) else ""
        verdict = getattr(event, "provisional", None)
        words.append(f"{word}{early}{f' {verdict}' if verdict else ''}")
    return words


def lines(events: Sequence[Event]) -> list[dict[str, Any]]:
    return [{"type": type(e).__name__.lower()} | {f.name: getattr(e, f.name) for f in fields(e)} for e in events]


# --- when it is said


def test_it_is_said_once_while_the_finger_is_down_and_confirmed() -> None:
    seer = Seer()
    events = run(recognizer(seer), frames(IDLE, SWIPE, PAUSE))
    assert names(events) == ["onset", "left?", "left confirmed", "release"]
    onset, early, answer, _ = events
    assert isinstance(early, Provisional) and isinstance(answer, Gesture) and isinstance(onset, Onset)
    assert (early.sensor, early.id, early.gesture, early.onset) == ("armrest", answer.id, "left", onset.onset)
    assert early.confidence == pytest.approx(0.95) and onset.onset < early.decided < answer.offset < answer.decided
    assert len(seer.looked) == 2 and seer.asked == 1  # two frames in a row, and nothing once it is said


def test_so_many_frames_in_a_row_must_be_sure_of_the_same() -> None:
    script = [says("left", 0.5), says("left"), says("right"), says("left"), says("left"), says("right"), says("right")]
    seer = Seer(early=lambda segment: script[len(seer.looked) - 1])
    events = run(recognizer(seer), frames(IDLE, SWIPE, PAUSE))
    assert names(events)[1] == "left?" and len(seer.looked) == 5


def test_the_threshold_is_that_of_the_time_since_the_onset() -> None:
    certainty = Certainty(1, (0.0, 0.2, 0.4), (None, 0.96, 0.9), {"right": (0.5, 0.5, 0.5)})
    seer = Seer(certainty=certainty)
    early = [event for event in run(recognizer(seer), frames(IDLE, SWIPE, PAUSE)) if isinstance(event, Provisional)]
    assert [0.4 <= event.decided - event.onset < 0.48 for event in early] == [True]
    seer = Seer(early=lambda segment: says("right", 0.6), certainty=certainty)
    early = [event for event in run(recognizer(seer), frames(IDLE, SWIPE, PAUSE)) if isinstance(event, Provisional)]
    assert [event.decided - event.onset for event in early] == [0.0]


def test_where_nothing_can_be_said_the_model_is_not_asked() -> None:
    seer = Seer(certainty=Certainty(1, (0.0, 0.3), (None, 0.99)))
    run(recognizer(seer), frames(IDLE, SWIPE, PAUSE))
    assert seer.looked and all(segment.offset - segment.onset >= 0.3 for segment in seer.looked)


@pytest.mark.parametrize(
    ("answer", "expected"),
    [
        (says("right"), "right revoked"),
        (says("left", 0.3), "unknown revoked"),
        (ModelError("broken"), "cancelled revoked"),
    ],
)
def test_another_answer_revokes_it(answer: Scores | Exception, expected: str) -> None:
    events = run(recognizer(Seer(answer=lambda segment: answer)), frames(IDLE, SWIPE, PAUSE))
    assert names(events) == ["onset", "left?", expected, "release"]


@pytest.mark.parametrize("line", ["press 4,4 0.8 for 6s", SWIPE + "\nsilence for 3s", SWIPE + "\nend"])
def test_a_contact_that_is_cancelled_revokes_it(line: str) -> None:
    subject = recognizer(Seer())
    stream = frames(IDLE, *line.removesuffix("\nend").split("\n"), *(() if line.endswith("end") else (PAUSE,)))
    events = run(subject, stream) + events_of(subject.reset())
    assert names(events) == ["onset", "left?", "cancelled revoked", "release"]


def test_a_look_that_fails_says_nothing_and_changes_nothing_else() -> None:
    stream = frames(IDLE, SWIPE, PAUSE)
    events = run(recognizer(Seer(early=lambda segment: ModelError("broken"))), stream)
    assert events == run(recognizer(Seer(), asked=False), stream) and len(events) == 3


@pytest.mark.parametrize("asked", [True, False])
def test_without_thresholds_or_without_anybody_who_asks_the_model_is_not_asked(asked: bool) -> None:
    seer = Seer(certainty=None if asked else CERTAINTY)
    assert names(run(recognizer(seer, asked=asked), frames(IDLE, SWIPE, PAUSE, TAP, PAUSE)))[:3] == [
        "onset", "left", "release",
    ]  # fmt: skip
    assert seer.looked == [] and seer.asked == 2


def test_what_the_configuration_asks_for_holds_where_it_is_more() -> None:
    stream = frames(IDLE, SWIPE, PAUSE)
    assert "left?" in names(run(recognizer(Seer(), thresholds={"left": 0.2}), stream))
    assert names(run(recognizer(Seer(), thresholds={"left": 0.97}), stream)) == ["onset", "unknown", "release"]
    low = Certainty(1, (0.0,), (0.3,))
    unsure = Seer(early=lambda segment: says("left", 0.45), certainty=low)  # the model's own threshold is 0.5
    assert "left?" not in names(run(recognizer(unsure), stream))


@pytest.mark.parametrize(
    ("floor", "least", "said"), [(None, 0.4, True), (0.44, 0.4, True), (0.46, 0.4, False), (0.2, 0.46, False)]
)
def test_an_operating_point_may_ask_for_more_than_the_rule(floor: float | None, least: float, said: bool) -> None:
    point = Point(dict.fromkeys(GESTURES, least), floor, 0.0, 0.0, 1.0)
    points = {"strict": point, "normal": replace(point, provisional=1.0)}
    told = replace(says("left", 0.45), points=points)
    seer = Seer(lambda segment: told, lambda segment: told, Certainty(1, (0.0,), (0.3,)))
    found = names(run(recognizer(seer, strictness="strict"), frames(IDLE, SWIPE, PAUSE)))
    assert ("left?" in found) == said
    assert ("unknown" in found) == (least > 0.45)  # the floor is of provisional events alone


def test_only_gestures_in_use_are_said() -> None:
    seer = Seer(early=lambda segment: says("right"), answer=lambda segment: says("right"))
    events = run(recognizer(seer, gestures=["left", "one_tap"]), frames(IDLE, SWIPE, PAUSE))
    assert names(events) == ["onset", "unknown", "release"]


def test_what_would_not_be_repeated_is_not_said() -> None:
    events = run(recognizer(Seer(), refractory={"left": 9.0}), frames(IDLE, SWIPE, PAUSE, SWIPE, PAUSE))
    assert names(events) == ["onset", "left?", "left confirmed", "release", "onset", "cancelled", "release"]


def test_a_contact_with_a_hole_is_not_named() -> None:
    stream = frames(IDLE, SWIPE, PAUSE)
    first = next(n for n, frame in enumerate(stream) if frame.values.max() > 500)
    events = run(recognizer(Seer()), stream[: first + 1] + stream[first + 6 :])
    assert names(events) == ["onset", "unknown", "release"]
    assert [event.reason for event in events if isinstance(event, Unknown)] == ["hole"]


# --- taps


def taps_and_others(segment: Segment) -> Scores:
    """One tap where all that was touched is short, two where it is longer and stays; a swipe where it moves."""
    touched = segment.frames[segment.first : segment.last + 1]
    columns = np.arange(9) @ touched.sum(axis=1).T / np.maximum(touched.sum(axis=(1, 2)), 1e-9)
    if np.ptp(columns[touched.max(axis=(1, 2)) > 100]) > 1.5:
        return says("left")
    return says("one_tap" if segment.offset - segment.onset < 0.25 else "double_tap")


def hand() -> Seer:
    return Seer(answer=taps_and_others, early=taps_and_others)


def test_a_tap_is_said_once_the_finger_has_left_and_is_answered_as_if_nobody_asked() -> None:
    seer = hand()
    events = run(recognizer(seer), frames(IDLE, TAP, PAUSE))
    assert names(events) == ["onset", "one_tap?", "one_tap confirmed", "release"]
    early, answer = events[1], events[2]
    assert isinstance(early, Provisional) and isinstance(answer, Gesture)
    assert early.decided - answer.offset == pytest.approx(0.085) and answer.decided - answer.offset > 0.5
    quiet = hand()
    run(recognizer(quiet, asked=False), frames(IDLE, TAP, PAUSE))
    assert seer.asked == quiet.asked == 1


def test_a_tap_that_a_gesture_of_ones_own_will_have_is_not_said() -> None:
    own = replace(says("one_tap"), own=Match("slash", 0.99, True))
    events = run(recognizer(Seer(lambda segment: own, lambda segment: own)), frames(IDLE, TAP, PAUSE))
    assert names(events) == ["onset", "slash", "release"]


def test_a_second_tap_revokes_it() -> None:
    events = run(recognizer(hand()), frames(IDLE, TAP, SHORT, TAP, PAUSE))
    assert names(events) == ["onset", "one_tap?", "double_tap revoked", "release"]


def test_two_taps_are_said_where_one_was_not() -> None:
    stream = frames(IDLE, TAP, SHORT, TAP, PAUSE)
    assert names(run(recognizer(hand(), taps=False), stream)) == [
        "onset", "double_tap?", "double_tap confirmed", "release",
    ]  # fmt: skip
    assert names(run(recognizer(hand(), taps=False), frames(IDLE, TAP, PAUSE))) == ["onset", "one_tap", "release"]
    never = Seer(taps_and_others, taps_and_others, replace(CERTAINTY, tap=None))
    assert names(run(recognizer(never), stream))[1] == "double_tap?"


def test_a_tap_and_a_swipe_are_two_contacts_each_with_its_own() -> None:
    stream = frames(IDLE, TAP, SHORT, SWIPE, PAUSE)
    for taps in (True, False):
        events = run(recognizer(hand(), taps=taps), stream)
        one = ["one_tap?", "one_tap confirmed"] if taps else ["one_tap"]
        assert names(events) == ["onset", *one, "release", "onset", "left?", "left confirmed", "release"]
        assert violations(lines(events)) == []


def test_without_double_tap_a_tap_is_said_before_its_answer_too() -> None:
    events = run(recognizer(hand(), gestures=["one_tap", "left"]), frames(IDLE, TAP, PAUSE))
    assert names(events) == ["onset", "one_tap?", "one_tap confirmed", "release"]


# --- what the model is shown, and how often


def test_the_model_is_shown_what_has_come_so_far_and_nothing_else() -> None:
    """Two hands that begin alike and go on differently: as long as they are alike, the model sees the same."""
    begin = "move 4,1 to 4,4 0.8 in 400ms"
    one, other = Seer(early=lambda s: says("left", 0.5)), Seer(early=lambda s: says("left", 0.5))
    first = frames(IDLE, begin, "move 4,4 to 4,7 0.8 in 400ms", PAUSE)
    second = frames(IDLE, begin, "move 4,4 to 8,4 1.0 in 400ms", PAUSE)
    run(recognizer(one), first)
    run(recognizer(other), second)
    alike = next(n for n, (a, b) in enumerate(zip(first, second, strict=True)) if (a.values != b.values).any())
    before = [segment for segment in one.looked if segment.times[-1] < first[alike].t]
    assert len(before) >= 4
    for shown, also in zip(before, other.looked, strict=False):
        assert np.array_equal(shown.frames, also.frames) and shown.offset == shown.times[-1] == also.times[-1]


@pytest.mark.parametrize("rate", [5, 14, 15, 16, 20, 25, 30, 60, 100, 250, 1000])
def test_the_model_looks_at_most_fifteen_times_a_second(rate: float) -> None:
    seer = Seer(early=lambda segment: says("left", 0.5))
    stream = frames(f"sensor rate {rate}", IDLE, "move 4,1 to 4,7 0.8 in 3s", PAUSE)
    run(recognizer(seer), stream)
    looked = [segment.offset for segment in touching(seer)]
    assert len(seer.looked) <= len(looked) + 1  # once more when the finger has left
    assert len(looked) == len(set(looked)) <= 3 * min(15, rate) + 2
    assert len(looked) >= 3 * min(7.5, rate) - 2
    if rate <= 15:
        assert np.diff(looked) == pytest.approx(1 / rate, abs=1e-5)  # each frame


@pytest.mark.parametrize("seed", range(5))
def test_jitter_skips_no_frame_at_the_nominal_rate(seed: int) -> None:
    seer = Seer(early=lambda segment: says("left", 0.5))
    stream = frames("sensor rate 15 jitter 8ms", "quiet for 4s", "move 4,1 to 4,7 0.8 in 3s", PAUSE, seed=seed)
    run(recognizer(seer), stream)
    times = [frame.t for frame in stream]
    looked = [segment.offset for segment in touching(seer)]
    assert looked == [t for t in times if looked[0] <= t <= looked[-1]]


# --- no answer depends on it


def oracle(segment: Segment, salt: bytes = b"") -> Scores:
    """Scores by the last bit of all that a segment holds: whatever is different is answered differently."""
    digest = hashlib.sha256(
        segment.frames.tobytes() + segment.times.tobytes() + repr((segment.first, segment.last, segment.noise)).encode()
        + salt
    ).digest()  # fmt: skip
    values = np.frombuffer(digest[:4], np.uint8).astype(np.float32) ** 4 + 1
    return Scores((values / values.sum()).astype(np.float32), digest[4] / 1024, "oracle", threshold=0.4)


@dataclass
class Dawdling(Clock):
    """A run is measured as late as it was, but no other time passes: else previews would bring rungs back sooner."""

    late: float = 0.0  # s, of the next reading alone

    def __call__(self) -> float:
        now, self.late = super().__call__() + self.late, 0.0
        return now


@dataclass
class Rung(Model):
    """Fails or dawdles with some segments, by what they hold."""

    name: str
    clock: Dawdling
    certainty: Certainty | None
    gestures: tuple[str, ...] = GESTURES
    rows: int = 9
    columns: int = 9

    def classify(self, segment: Segment) -> Scores:
        scores = oracle(segment, self.name.encode())
        mood = int(scores.values[0] * 1e6) % 8
        if mood == 0:
            raise RuntimeError("broken")
        self.clock.late = 0.2 if mood % 2 else 0.0
        values = np.full(4, np.nan, np.float32) if mood == 2 else scores.values
        return Scores(values, scores.unknown, self.name, threshold=0.4)


EAGER = Certainty(1, (0.0, 0.1), (0.3, 0.3), {"right": (0.2, None)}, tap=0.2)
STEPS = st.sampled_from(
    [TAP, SWIPE, SHORT, PAUSE, "quiet for 400ms", "move 7,4 to 1,4 0.4 in 250ms", "press 2,2 0.3 for 400ms",
     "press 4,4 0.9 for 5600ms", "silence for 300ms", "silence for 2s", "lose 4", "dead 4,4", "shift 900",
     "circle 4,4 radius 2 0.7 in 800ms", "press 4,4 0.8 for 1 frame"]
)  # fmt: skip


def answers_of(
    make: Callable[[], tuple[Any, Clock]], stream: Sequence[Frame], *, asked: bool, looks: Sequence[bool] = ()
) -> list[Event]:
    """`looks`: after which frames, in turn, there is time for a provisional event; none: it is given at once."""
    classifier, clock = make()
    subject = recognizer(classifier, thresholds={"left": 0.5}, refractory={"one_tap": 2.0})
    subject.foresee(asked=asked, later=bool(looks))
    events: list[Event] = []
    for n, frame in enumerate(stream):
        clock.now = 10 * frame.t  # so fast that rungs which were put aside come back within a stream
        events += events_of(subject.push(frame))
        if isinstance(classifier, Ladder):
            subject.ask()  # as a loop that has time: each run of a rung counts, also of an answer that never comes due
        if looks and looks[n % len(looks)]:
            events += events_of(subject.look())
    return events + events_of(subject.flush(stream[-1].t + 0.2))


def bare(events: Sequence[Event]) -> list[Event]:
    """Without what is there only because somebody asked."""
    return [
        replace(event, provisional=None) if isinstance(event, Gesture | Unknown | Cancelled) else event
        for event in events
        if not isinstance(event, Provisional)
    ]


def an_oracle() -> tuple[Any, Clock]:
    return Seer(answer=oracle, early=lambda segment: oracle(segment, b"early"), certainty=EAGER), Clock()


def a_ladder() -> tuple[Any, Clock]:
    clock = Dawdling()
    rungs = [Rung("best", clock, EAGER), Rung("second", clock, None), Rung("third", clock, EAGER)]
    return Ladder(rungs, clock=clock), clock


@pytest.mark.parametrize("make", [an_oracle, a_ladder])
@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(["15", "15 jitter 15ms", "60"]),
    st.lists(STEPS, min_size=2, max_size=12),
    st.lists(st.booleans(), max_size=9),
)
@example("15", [TAP, "press 4,4 0.8 for 1 frame", SHORT, TAP], [False])  # "best" fails at what may be the first tap
def test_answers_are_the_same_whether_or_not_anybody_asks(
    make: Callable[[], tuple[Any, Clock]], rate: str, steps: list[str], looks: list[bool]
) -> None:
    stream = frames(f"sensor rate {rate}", IDLE, *steps, PAUSE)
    asked, unasked = (answers_of(make, stream, asked=asked, looks=looks) for asked in (True, False))
    assert bare(asked) == unasked
    assert violations(lines(asked)) == [] == violations(lines(unasked))


def test_the_property_above_sees_provisional_events_and_all_rungs() -> None:
    stream = frames(IDLE, *[SWIPE, PAUSE, TAP, PAUSE, TAP, SHORT, SWIPE, PAUSE] * 12)
    for make, models in ((an_oracle, {"oracle"}), (a_ladder, {"best", "second", "third"})):
        events = answers_of(make, stream, asked=True)
        assert {getattr(event, "provisional", None) for event in events} == {None, "confirmed", "revoked"}
        assert {event.model for event in events if isinstance(event, Gesture | Unknown)} == models


# --- the ladder


def test_a_ladder_that_is_asked_early_keeps_its_books() -> None:
    clock, said = Dawdling(), []
    ladder = Ladder([Rung("best", clock, CERTAINTY), Rung("second", clock, None)], clock=clock, report=said.append)
    assert ladder.certainty is CERTAINTY
    stream = frames(IDLE, *[SWIPE, PAUSE] * 20)
    cut = Seer(certainty=Certainty(1, (0.0,), (1.0,)))
    run(recognizer(cut), stream)
    for segment in cut.looked:
        ladder.preview(segment)
    assert len(cut.looked) > 100 and (ladder.active, ladder.failures, said) == ("best", 0, [])


def test_a_ladder_that_is_slow_is_not_asked_early_for_a_while() -> None:
    clock, calls = Dawdling(), []

    class Slow(Rung):
        def classify(self, segment: Segment) -> Scores:
            calls.append(segment)
            clock.now += 0.2
            return says("left")

    ladder = Ladder([Slow("slow", clock, CERTAINTY)], clock=clock)
    one = Segment(np.zeros((2, 9, 9), np.float32), np.array([0.0, 0.1]), 0, 1, 1.0)
    said = [ladder.preview(one) is not None for _ in range(SLOW_RUNS + 2)]
    assert said == [True] * SLOW_RUNS + [False] * 2 and len(calls) == SLOW_RUNS
    clock.now += RETRY_S + 1.0
    assert ladder.preview(one) is not None


# --- the hub


SCENE = Scene(("one_tap", "double_tap", "left", "right"), (9, 9))


def feed(hub: Hub, name: str, stream: Sequence[Any], t: float) -> list[Any]:
    facts = []
    for n, frame in enumerate(stream, start=1):
        facts += hub.receive([(floats(f"/{name}/pressure", frame, 0), ("10.0.0.1", 1))], t + n / 15)
    return facts


def test_only_sensors_that_somebody_asks_for_cost_a_run() -> None:
    seer = Seer()
    hub = Hub(SCENE, seer)
    for name in ("before", "other"):
        feed(hub, name, Hand().idle(2.0), 0.0)
    hub.foresee(("before", "after"))
    assert hub.foreseen("after") and not hub.foreseen("other")
    for name in ("before", "after", "other"):
        hand = Hand()
        facts = feed(hub, name, [*hand.idle(2.0), *hand.swipe("left"), *hand.idle(1.0)], 10.0)
        assert any(isinstance(fact, Provisional) for fact in facts) == (name != "other")
    looked = len(seer.looked)
    hub.foresee(())
    assert not any(isinstance(fact, Provisional) for fact in feed(hub, "before", hand.swipe("left"), 20.0))
    assert len(seer.looked) == looked > 0


def test_what_waits_for_its_turn_is_looked_at_one_at_a_time_and_not_said_once_it_is_old() -> None:
    seer = Seer(certainty=replace(CERTAINTY, in_a_row=1))
    hub = Hub(SCENE, seer, later=True)
    hub.foresee(None)
    sensors = {name: Hand() for name in ("one", "two", "three")}
    for name, hand in sensors.items():
        feed(hub, name, [*hand.idle(2.0), *hand.swipe("left")[:3]], 0.0)
    assert hub.looks and not seer.looked
    assert [[one.sensor for one in hub.look(2.2)] for _ in range(2)] == [["one"], ["two"]]
    assert hub.looks and len(seer.looked) == 2 and not seer.asked
    hand = sensors["three"]
    facts = feed(hub, "three", [*hand.swipe("left")[3:], *hand.idle(1.0)], 2.2)
    assert names([fact for fact in facts if isinstance(fact, Event)]) == ["left", "release"]  # there was no time for it
    assert hub.look(9.0) == [] and not hub.looks and len(seer.looked) == 2


@pytest.mark.parametrize("time", [True, False])
def test_what_may_soon_be_answered_is_asked_about_one_at_a_time_and_else_when_it_is_due(time: bool) -> None:
    """The answers are the same; each segment is asked about once."""
    seer = Seer()
    hub = Hub(SCENE, seer, later=True)
    sensors = {name: Hand() for name in ("one", "two")}
    for name, hand in sensors.items():
        feed(hub, name, [*hand.idle(2.0), *hand.tap(), *hand.idle(0.3)], 0.0)
    assert list(hub.asks) == ["one", "two"] and not seer.asked
    for asked in (1, 2) if time else ():
        assert hub.ask(2.5) == [] and seer.asked == asked
    assert bool(hub.asks) != time
    told = [feed(hub, name, hand.idle(1.0), 2.5) for name, hand in sensors.items()]
    for facts in told:
        assert [one.gesture for one in facts if isinstance(one, Gesture)] == ["left"]
    assert hub.ask(4.0) == [] and not hub.asks


@pytest.mark.parametrize("looks", [[True], [True, False]])
def test_what_is_looked_at_later_is_said_as_if_it_had_been_at_once(looks: list[bool]) -> None:
    stream = frames(IDLE, *[SWIPE, PAUSE, TAP, PAUSE, TAP, SHORT, SWIPE, PAUSE] * 3)
    later = answers_of(an_oracle, stream, asked=True, looks=looks)
    said, at_once = (
        {one.id: one for one in events if isinstance(one, Provisional)}
        for events in (later, answers_of(an_oracle, stream, asked=True))
    )
    assert said and said.keys() <= at_once.keys()
    if all(looks):
        assert [one.gesture for one in said.values()] == [one.gesture for one in at_once.values()]


@pytest.mark.parametrize("how", ["reload", "no longer asked", "bug"])
def test_what_was_said_is_judged_whatever_happens_meanwhile(how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    hub, hand = Hub(SCENE, Seer()), Hand()
    hub.foresee(None)
    swipe = hand.swipe("left")
    facts = feed(hub, "arm", [*hand.idle(2.0), *swipe[:-2]], 0.0)
    assert names([fact for fact in facts if isinstance(fact, Event)]) == ["onset", "left?"]
    now = (len(swipe) + 28) / 15
    if how == "reload":
        hub.change(replace(SCENE, thresholds={"left": 0.1}), Seer(), now)
    elif how == "no longer asked":
        hub.foresee(())
    else:
        monkeypatch.setattr("gestured.core.front_end.FrontEnd.push", lambda *_: 1 / 0)
    facts = feed(hub, "arm", [*swipe[-2:], *hand.idle(1.0)], now)
    expected = ["cancelled revoked", "release"] if how == "bug" else ["left confirmed", "release"]
    assert names([fact for fact in facts if isinstance(fact, Event)]) == expected
    assert any(isinstance(fact, Fault) for fact in facts) == (how == "bug")
