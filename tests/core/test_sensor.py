"""From frames to events: decisions with a classifier that says what it is told to, and the front end's grammar.

Streams are written as in tests/scenarios; times are written down.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gestured.core.classifier import Classifier, Scores
from gestured.core.errors import ModelError
from gestured.core.events import Cancelled, Event, Gesture, Onset, Release, Unknown
from gestured.core.facts import events_of
from gestured.core.frames import UNDISTURBED, Frame, Segment
from gestured.core.front_end import Cut, Found, FrontEnd, Void
from gestured.core.points import STRICTNESS, Point
from gestured.core.scene import Scene, Setup
from gestured.core.sensor import Sensor
from gestured.core.window import Window
from tests.scenario import contacts, frames

GESTURES = ("double_tap", "left", "right")
TAP = "press 4,4 0.8 for 130ms"
SWIPE = "move 4,1 to 4,7 0.8 in 400ms"


def says(*values: float, unknown: float = 0.0, threshold: float = 0.5) -> Scores:
    return Scores(np.array(values, dtype=np.float32), unknown, "fake", threshold=threshold)


DOUBLE = ("quiet for 1500ms", TAP, "quiet for 150ms", TAP, "quiet for 900ms")
SURE = says(0.9, 0.06, 0.04)


@dataclass
class Fake(Classifier):
    """Gives one answer after the other, the last one for ever; an exception is raised."""

    answers: Sequence[Scores | Exception] = (SURE,)
    gestures: tuple[str, ...] = GESTURES
    seen: list[Segment] = field(default_factory=list)

    def classify(self, segment: Segment) -> Scores:
        answer = self.answers[min(len(self.seen), len(self.answers) - 1)]
        self.seen.append(segment)
        if isinstance(answer, Exception):
            raise answer
        return answer


def recognizer(classifier: Any, sequence: int = 0, **settings: Any) -> Sensor:
    scene = Scene(**{"gestures": classifier.gestures, "grid": (9, 9)} | settings)
    return Sensor("armrest", scene, classifier, numbers=(sequence, 0))


def reload(subject: Sensor, classifier: Fake) -> None:
    subject.change(Scene(classifier.gestures, (9, 9)), classifier, 0.0, [])


def run(subject: Sensor, stream: Sequence[Frame]) -> list[Event]:
    return events_of(event for frame in stream for event in subject.push(frame))


def answers(events: Sequence[Event]) -> list[Event]:
    return [event for event in events if isinstance(event, Gesture | Unknown | Cancelled)]


def swipes(count: int, pause: str = "600ms") -> list[Frame]:
    return frames("quiet for 1500ms", *[SWIPE, f"quiet for {pause}"] * count)


# --- when the classifier is asked


@pytest.mark.parametrize("lines", [(SWIPE,), (TAP,), (TAP, "quiet for 150ms", TAP)])
def test_the_answer_is_there_before_the_wait_is_over(lines: tuple[str, ...]) -> None:
    classifier = Fake()
    subject = recognizer(classifier)
    asked = []
    for frame in frames("quiet for 1500ms", *lines, "quiet for 900ms"):
        events = answers(subject.push(frame))
        if events:
            assert asked[-1] == len(classifier.seen) == len(lines) // 2 + 1  # nothing is asked when it is decided
        asked.append(len(classifier.seen))
    assert asked[-1] == len(lines) // 2 + 1


def test_a_finger_that_comes_back_is_answered_by_all_that_it_did() -> None:
    tap, both = SURE, says(0, 0, 1)
    classifier = Fake([tap, both])
    (answer,) = answers(run(recognizer(classifier), frames(*DOUBLE)))
    assert isinstance(answer, Gesture) and answer.gesture == "right"
    first, second = classifier.seen
    assert first.onset == second.onset == answer.onset and first.offset < second.offset == answer.offset


def test_what_is_asked_ahead_is_what_is_cut() -> None:
    """A window ends 0.07 s after the last touched frame: no frame that comes later is in it."""
    window = Window(9, 9, 15.0, smooth_frames=1, lead_s=1 / 15, tail_s=1 / 15, floor=4.0)
    for line in (SWIPE, TAP, "move 1,1 to 7,7 0.5 in 700ms"):
        stream = frames("quiet for 1500ms", line, "quiet for 900ms")
        classifier, front_end = Fake(), FrontEnd(9, 9)
        run(recognizer(classifier), stream)
        (segment,) = [x.segment for frame in stream for x in front_end.push(frame) if isinstance(x, Cut)]
        (asked,) = classifier.seen
        (longer,) = cut_late(stream)
        assert np.array_equal(asked.frames, segment.frames)
        assert np.array_equal(window.apply(asked), window.apply(longer))
        assert len(longer.frames) > len(asked.frames) or line != TAP


def cut_late(stream: Sequence[Frame]) -> list[Segment]:
    """Segments with all frames up to their cut: nothing is drafted before."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gestured.core.front_end.DRAFT_S", math.inf)
        return [x.segment for x in cut_out(stream) if isinstance(x, Cut)]


# --- what nobody saw


SLOW_SWIPE = ("quiet for 1500ms", "move 4,1 to 4,7 0.8 in 800ms", "quiet for 900ms")


def touched(stream: Sequence[Frame]) -> tuple[int, int]:
    """First and last frame of the one contact."""
    (cut,) = [x for x in cut_out(stream) if isinstance(x, Cut)]
    times = [frame.t for frame in stream]
    return times.index(cut.segment.onset), times.index(cut.segment.offset)


def cut_out(stream: Sequence[Frame]) -> list[Found]:
    front_end = FrontEnd(9, 9)
    return [x for frame in stream for x in contacts(front_end, frame)]


@pytest.mark.parametrize("where", [-4, 0, 1, 9, 11])  # frames from the onset; the last touched one is the eleventh
@pytest.mark.parametrize(("lost", "kind"), [(2, Gesture), (5, Unknown)])
def test_a_gesture_with_a_hole_is_unknown(where: int, lost: int, kind: type) -> None:
    stream = frames(*SLOW_SWIPE)
    at = touched(stream)[0] + where
    (answer,) = answers(run(recognizer(Fake()), stream[:at] + stream[at + lost :]))
    assert isinstance(answer, kind)


@pytest.mark.parametrize(
    ("lines", "lost", "kind"),
    [
        (("move 4,1 to 4,7 0.8 in 800ms",), 5, Gesture),
        (("move 4,1 to 4,7 0.8 in 800ms",), 6, Unknown),  # too long
        (("circle 4,4 radius 2.5 0.8 in 1200ms",), 3, Gesture),
        (("move 7,1 to 1,1 0.8 in 400ms", "move 1,1 to 1,7 0.8 in 400ms"), 4, Unknown),  # a corner
        (("move 4,1 to 4,7 0.8 in 400ms", "move 4,7 to 4,1 0.8 in 400ms"), 4, Unknown),  # to and fro
        (("press 4,4 0.8 for 800ms",), 4, Unknown),  # a second tap may hide
        ((TAP, "quiet for 200ms", TAP), 3, Unknown),
    ],
)
def test_a_hole_on_a_clear_path_hides_nothing(lines: tuple[str, ...], lost: int, kind: type) -> None:
    stream = frames("quiet for 1500ms", *lines, "quiet for 900ms")
    at = (sum(touched(stream)) - lost + 1) // 2
    (answer,) = answers(run(recognizer(Fake()), stream[:at] + stream[at + lost :]))
    assert isinstance(answer, kind)
    assert getattr(answer, "reason", "hole") == "hole"


def test_a_hole_while_a_second_tap_is_waited_for() -> None:
    stream = frames("quiet for 1500ms", TAP, "quiet for 900ms")
    at = touched(stream)[1] + 3
    (answer,) = answers(run(recognizer(Fake()), stream[:at] + stream[at + 4 :]))
    assert isinstance(answer, Unknown)


@pytest.mark.parametrize("where", [-4, 0, 3, 9])
def test_a_sensor_that_repeats_itself_has_seen_nothing(where: int) -> None:
    stream = frames(*SLOW_SWIPE)
    at = touched(stream)[0] + where
    for n in range(at + 1, at + 6):
        stream[n] = replace(stream[n], values=stream[at].values)
    assert not [event for event in run(recognizer(Fake()), stream) if isinstance(event, Gesture)]


@pytest.mark.parametrize(("before", "kind"), [((), Unknown), (("quiet for 1 frame",), Gesture)])
def test_a_finger_that_is_there_when_a_sensor_begins_again_was_not_seen_coming(
    before: tuple[str, ...], kind: type
) -> None:
    stream = frames("quiet for 1500ms", "silence for 3s", *before, *SLOW_SWIPE[1:])
    (answer,) = answers(run(recognizer(Fake()), stream))
    assert isinstance(answer, kind)


def test_a_touch_as_soon_as_the_sensor_is_ready_has_no_hole() -> None:
    """The quiet second from which it was learned has shown that nobody touched it."""
    kinds = []
    for ms in range(880, 1200, 10):
        for line in (SWIPE, TAP):
            kinds += map(type, answers(run(recognizer(Fake()), frames(f"quiet for {ms}ms", line, "quiet for 900ms"))))
    assert len(kinds) > 30 and set(kinds) == {Gesture}


def test_a_slow_sensor_may_show_the_same_twice_before_it_is_touched() -> None:
    stream = frames("quiet for 1500ms", "move 4,1 to 4,7 0.8 in 1500ms", "quiet for 1500ms")[::3]
    at = touched(stream)[0] - 1
    stream[at] = replace(stream[at], values=stream[at - 1].values)
    (answer,) = answers(run(recognizer(Fake()), stream))
    assert isinstance(answer, Gesture)


@pytest.mark.parametrize(("rate", "reason"), [(3, "rate"), (5, "confidence"), (15, "confidence"), (1000, "confidence")])
def test_a_rate_that_the_models_do_not_know_is_the_reason(rate: int, reason: str) -> None:
    stream = frames(f"sensor rate {rate}", "quiet for 3s", "move 4,1 to 4,7 0.8 in 1500ms", "quiet for 2s")
    (answer,) = answers(run(recognizer(Fake([says(0.2, 0.2, 0.2)])), stream))
    assert isinstance(answer, Unknown) and answer.reason == reason


@dataclass
class Surrounded(Fake):
    """Finds a segment less likely to be a gesture after another one."""

    value: float = 0.9
    answers_alone: bool = True
    previews: int = 0

    def classify(self, segment: Segment) -> Scores:
        self.seen.append(segment)
        return says(self.value, 1 - self.value, 0.0, unknown=0.1 if segment.before == UNDISTURBED else 0.9)

    def preview(self, segment: Segment) -> Scores | None:
        self.previews += 1
        return self.classify(segment) if self.answers_alone else None


def test_a_gesture_that_only_its_surroundings_make_unsure_has_them_as_the_reason() -> None:
    classifier, told, asked = Surrounded(), list[Event](), 0
    subject = recognizer(classifier)
    for frame in swipes(2):
        events = answers(subject.push(frame))
        assert not events or asked == len(classifier.seen)  # nothing is asked when it is decided
        told, asked = told + events, len(classifier.seen)
    alone, soon = told
    assert isinstance(alone, Gesture) and isinstance(soon, Unknown)
    assert soon.reason == "context" and soon.confidence == pytest.approx(0.9 * 0.1)
    assert classifier.previews == 1 and soon.scores == alone.scores


@pytest.mark.parametrize(
    ("classifier", "least", "previews"),
    [
        (Surrounded(value=0.54), 0.5, 1),  # alone it would not be sure enough either
        (Surrounded(answers_alone=False), 0.5, 1),
        (Surrounded(), 0.95, 0),  # the score alone is too low, so that no run of the model is needed
    ],
)
def test_other_reasons_are_not_taken_for_the_surroundings(classifier: Surrounded, least: float, previews: int) -> None:
    *_, soon = answers(run(recognizer(classifier, thresholds={"double_tap": least}), swipes(2)))
    assert isinstance(soon, Unknown)
    assert (soon.reason, classifier.previews) == ("confidence", previews)


# --- what is decided


def test_a_gesture_says_all_that_is_known_of_it() -> None:
    classifier = Fake([replace(says(0.1, 0.7, 0.2, unknown=0.1), model="rung", degraded=True)])
    subject = recognizer(classifier, sequence=41)
    stream = [replace(frame, lost=2 if 1.6 < frame.t < 1.68 else 0) for frame in swipes(1)]
    onset, gesture, release = run(subject, stream)
    (segment,) = classifier.seen
    assert onset == Onset("armrest", 1, segment.onset) and release == Release("armrest", 1, segment.offset)
    assert isinstance(gesture, Gesture)
    assert (gesture.sensor, gesture.id, gesture.gesture, gesture.sequence) == ("armrest", 1, "left", 42)
    assert gesture.confidence == pytest.approx(0.7 * 0.9)
    assert gesture.scores == pytest.approx(dict(zip(GESTURES, (0.1, 0.7, 0.2), strict=True)))
    assert (gesture.onset, gesture.offset) == (segment.onset, segment.offset)
    assert gesture.frames == segment.last - segment.first + 1 == 6 and gesture.lost == 2
    assert (gesture.model, gesture.degraded) == ("rung", True)
    quiet_since = next(frame.t for frame in stream if frame.t > gesture.offset)
    assert gesture.decided == pytest.approx(quiet_since + 0.1)
    assert subject.sequence == 42


@given(
    st.lists(st.floats(0.0, 1.0, width=32), min_size=3, max_size=3), st.floats(0, 1), st.floats(0, 1),
    st.dictionaries(st.sampled_from(GESTURES), st.floats(0, 1)),
)  # fmt: skip
def test_the_best_gesture_counts_if_it_is_sure_enough(
    values: list[float], unknown: float, threshold: float, own: dict[str, float]
) -> None:
    subject = recognizer(Fake([says(*values, unknown=unknown, threshold=threshold)]), thresholds=own)
    (answer,) = answers(run(subject, SWIPED))
    best = GESTURES[int(np.argmax(values))]
    assert isinstance(answer, Gesture | Unknown)
    assert answer.confidence == pytest.approx(max(values) * (1 - unknown))
    assert isinstance(answer, Gesture) == (answer.confidence >= own.get(best, threshold))
    if isinstance(answer, Gesture):
        assert answer.gesture == best
    assert set(answer.scores) == set(GESTURES)


LEAST = st.floats(0, 1)
EACH = st.lists(LEAST, min_size=3, max_size=3)


@given(
    EACH, st.sampled_from([None, *STRICTNESS]), st.sampled_from(STRICTNESS), LEAST | st.none(),
    st.dictionaries(st.sampled_from(GESTURES), LEAST),
)  # fmt: skip
def test_a_threshold_is_the_scenes_else_the_operating_points_else_the_calibrations(
    by_strictness: list[float], one: str | None, usual: str, calibrated: float | None, own: dict[str, float]
) -> None:
    at = dict(zip(STRICTNESS, by_strictness, strict=True))
    points = {name: Point(dict.fromkeys(GESTURES, 0.0) | {"left": least}, None, 0, 0, 1) for name, least in at.items()}
    answer = says(0.1, 0.5, 0.4, threshold=0.0 if calibrated is None else calibrated)
    sensors = {"armrest": Setup(strictness=one), "other": Setup(strictness="eager")}
    subject = recognizer(
        Fake([replace(answer, points=points if calibrated is None else None)]),
        thresholds=own, strictness=usual, sensors=sensors,
    )  # fmt: skip
    (found,) = answers(run(subject, SWIPED))
    needed = own.get("left", at[one or usual] if calibrated is None else calibrated)
    assert isinstance(found, Gesture) == (needed <= 0.5)


SWIPED = swipes(1)


@pytest.mark.parametrize("confidence", [math.nan, -math.nan])
def test_a_confidence_that_is_no_number_is_no_gesture(confidence: float) -> None:
    (answer,) = answers(run(recognizer(Fake([says(confidence, confidence, confidence)])), SWIPED))
    assert isinstance(answer, Unknown)


def test_a_subset_is_not_given_what_falls_to_the_others() -> None:
    classifier = Fake([says(0.6, 0.3, 0.1)])
    (answer,) = answers(run(recognizer(classifier, gestures=["left", "right"]), SWIPED))
    assert isinstance(answer, Unknown)
    assert answer.confidence == pytest.approx(0.3) and answer.scores == pytest.approx({"left": 0.3, "right": 0.1})
    (answer,) = answers(run(recognizer(classifier, gestures=["right", "double_tap"]), SWIPED))
    assert isinstance(answer, Gesture) and answer.gesture == "double_tap" and answer.confidence == pytest.approx(0.6)


def test_a_gesture_is_not_repeated_within_its_refractory_time() -> None:
    """The time counts from the end of the last one that was published; the others are free."""
    tap, left = SURE, says(0, 1, 0)
    classifier = Fake([tap, tap, left, left, tap])
    events = run(recognizer(classifier, refractory={"double_tap": 2.5}), swipes(5))
    found = [(type(e), getattr(e, "reason", None) or e.gesture) for e in answers(events)]
    assert found == [
        (Gesture, "double_tap"), (Cancelled, "refractory"), (Gesture, "left"), (Gesture, "left"),
        (Gesture, "double_tap"),
    ]  # fmt: skip
    ends = [e.offset for e in events if isinstance(e, Release)]
    begins = [e.onset for e in events if isinstance(e, Onset)]
    assert begins[1] - ends[0] < 2.5 <= begins[4] - ends[0]  # a cancelled one does not prolong it


def test_a_reload_ends_no_refractory_pause() -> None:
    first, again = swipes(1), [replace(frame, t=frame.t + 3.0) for frame in swipes(1)]
    subject = recognizer(Fake(), refractory={"double_tap": 60.0})
    events = run(subject, first)
    subject.change(Scene(GESTURES, (9, 9), refractory={"double_tap": 30.0}), Fake(), 0.0, [])
    assert [type(event) for event in answers(events + run(subject, again))] == [Gesture, Cancelled]


def test_what_is_unknown_has_no_refractory_time() -> None:
    classifier = Fake([says(0.2, 0.1, 0.1), SURE])
    events = answers(run(recognizer(classifier, refractory={"double_tap": 60}), swipes(2)))
    assert [type(event) for event in events] == [Unknown, Gesture]


def test_what_is_no_failure_of_a_model_is_a_bug_and_loud() -> None:
    with pytest.raises(ZeroDivisionError):
        run(recognizer(Fake([ZeroDivisionError()])), SWIPED)


outcomes = st.sampled_from([SURE, says(0, 1, 0), says(0.3, 0.3, 0.3), ModelError("x")])


@settings(max_examples=25, deadline=None)
@example([ModelError("x"), SURE], 0)
@given(st.lists(outcomes, min_size=1, max_size=8), st.integers(0, 1000))
def test_the_sequence_counts_gestures_only_and_has_no_gaps(given_: list[Scores | Exception], start: int) -> None:
    subject = recognizer(Fake(given_), sequence=start, refractory={"left": 1.0})
    events = run(subject, swipes(len(given_)))
    assert len(answers(events)) == len(given_)
    assert {event.reason for event in events if isinstance(event, Cancelled)} <= {"model", "refractory"}
    gestures = [event for event in events if isinstance(event, Gesture)]
    assert [event.sequence for event in gestures] == list(range(start + 1, start + 1 + len(gestures)))
    assert subject.sequence == start + len(gestures)
    for number, (onset, answer, release) in enumerate(zip(events[::3], events[1::3], events[2::3], strict=True), 1):
        assert isinstance(onset, Onset) and isinstance(release, Release)
        assert onset.id == answer.id == release.id == number  # type: ignore[union-attr]


def test_another_strictness_holds_from_the_next_answer_on() -> None:
    at = {"eager": 0.2, "strict": 0.95}
    points = {name: Point(dict.fromkeys(GESTURES, least), None, 0, 0, 1) for name, least in at.items()}
    subject = recognizer(classifier := Fake([replace(SURE, points=points)]), strictness="eager")
    stream = swipes(1)
    middle = next(n for n, frame in enumerate(stream) if frame.t > 1.7)
    assert [type(event) for event in run(subject, stream[:middle])] == [Onset]
    subject.change(Scene(GESTURES, (9, 9), strictness="strict"), classifier, 1.7, [])
    assert [type(event) for event in run(subject, stream[middle:])] == [Unknown, Release]  # the contact goes on


def test_a_classifier_that_is_replaced_while_a_second_tap_is_waited_for_is_asked_anew() -> None:
    first = Fake()
    subject = recognizer(first)
    events = []
    for frame in frames("quiet for 1500ms", TAP, "quiet for 900ms"):
        events += answers(subject.push(frame))
        if first.seen:
            reload(subject, Fake([says(0.2, 0.8)], gestures=("double_tap", "zigzag")))
    assert [(type(event), event.gesture) for event in events] == [(Gesture, "zigzag")]  # type: ignore[union-attr]


# --- flush and reset

OPEN = {
    "nothing": ["quiet for 2s"],
    "finger": ["quiet for 1500ms", "move 4,1 to 4,7 0.8 in 400ms"],
    "lifted": ["quiet for 1500ms", "move 4,1 to 4,7 0.8 in 400ms", "quiet for 1 frame"],
    "tapped": ["quiet for 1500ms", TAP, "quiet for 300ms"],
    "held": ["quiet for 1500ms", "press 4,4 0.8 for 5500ms"],
}


@pytest.mark.parametrize("what", sorted(OPEN))
def test_a_reset_cancels_what_is_open_and_starts_clean(what: str) -> None:
    subject = recognizer(Fake())
    before = run(subject, frames(*OPEN[what]))
    events = before + subject.reset()
    reasons = [e.reason for e in events if isinstance(e, Cancelled)]
    assert reasons == {"nothing": [], "held": ["held"]}.get(what, ["restart"])
    ids = {kind: [e.id for e in events if isinstance(e, kind)] for kind in (Onset, Cancelled, Release)}
    assert ids[Onset] == ids[Cancelled] == ids[Release]
    assert not subject.front_end.ready and not subject.front_end.touched
    later = [replace(frame, t=frame.t + 20, values=frame.values + 400) for frame in SWIPED]  # it is learned anew
    onset, gesture, release = run(subject, later)
    assert isinstance(gesture, Gesture) and gesture.sequence == 1
    assert onset.id == gesture.id == release.id == len(ids[Onset]) + 1  # type: ignore[union-attr]


# --- silences


def kinds(events: Sequence[Found]) -> list[str]:
    return [event.reason if isinstance(event, Void) else type(event).__name__ for event in events]


@pytest.mark.parametrize("silence", [1.5, 3.0, 5.5, 60.0])
@pytest.mark.parametrize(("what", "answer"), [("lifted", "Cut"), ("tapped", "Cut"), ("finger", "silence")])
def test_a_silence_means_the_same_however_long_it_was(what: str, answer: str, silence: float) -> None:
    """A daemon asks after `stale_s`, replay when the next frame comes: both hear the same."""
    stream = frames(*OPEN[what])
    idle = stream[5].values
    front_end = FrontEnd(9, 9)
    for frame in stream:
        front_end.push(frame)
    assert kinds(contacts(front_end, Frame(stream[-1].t + silence, idle))) == [answer, "Ended"]
