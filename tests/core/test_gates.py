"""When a sensor is listened to: a gesture arms it, and gates silence it."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gestured.core.address import Address
from gestured.core.classifier import Scores
from gestured.core.events import Event, Gate, Gesture, Provisional, Unknown
from gestured.core.facts import Changed, Decided
from gestured.core.hub import Hub
from gestured.core.listening import Arming
from gestured.core.messages import to_json
from gestured.core.points import Certainty, Point
from gestured.core.scene import Scene, Setup
from gestured.record.replay import Replay, opened
from gestured.record.tape import Packet, Tape
from tests.core.test_foresight import Seer
from tests.core.test_foresight import recognizer as foreseeing
from tests.core.test_foresight import says as foretold
from tests.core.test_hub import FIRST, GESTURES, SECOND, Arrived, Sure, stream, write
from tests.core.test_sensor import SWIPE, Fake, answers, recognizer, run, says, swipes
from tests.daemon.harness import Hand
from tests.scenario import frames

LEFT, TAPS, NONE = says(0.02, 0.95, 0.03), says(0.95, 0.02, 0.03), says(0.4, 0.3, 0.3, unknown=0.9)


def drive(count: int = 6) -> list[Arrived]:
    """Packets of a sensor `arm` on which somebody swipes so many times, and of `seat`, on which nobody does."""
    hand = Hand(1)
    shown = hand.idle(1.5)
    for _ in range(count):
        shown += hand.swipe("left") + hand.idle(0.6)
    return sorted(stream("arm", shown, FIRST) + stream("seat", hand.idle(len(shown) / 15), ("10.0.0.2", 1)))


def played(
    arrived: list[Arrived], scene: Scene, *calls: tuple[float, str, str | None, str], armed_until: float | None = None
) -> list[Any]:
    """The facts of a hub of which a gate is inhibited or allowed (method, sensor, gate) at these times."""
    hub, todo = Hub(scene, Sure()), sorted(calls, key=lambda call: call[0])
    facts: list[Any] = [] if armed_until is None else hub.put("arm", scene.gates, 0.0, armed_until)
    for t, packet, source in arrived:
        while todo and todo[0][0] <= t:
            when, method, sensor, gate = todo.pop(0)
            facts += getattr(hub, method)(sensor, gate, when)
        facts += hub.receive([(packet, source)], t)
        facts += hub.tick(t)
    return [*facts, *hub.flush(arrived[-1][0] + 2.0)]


def gates(facts: list[Any]) -> list[tuple[str, bool | None, tuple[str, ...]]]:
    return [(fact.sensor, fact.armed, fact.closed) for fact in facts if isinstance(fact, Gate)]


def reasons(events: list[Event]) -> list[str]:
    """The answers: a gesture's name, or why there is none."""
    return [event.gesture if isinstance(event, Gesture) else str(event.reason) for event in answers(events)]


SCENE = Scene(GESTURES, (9, 9))
DRIVE = drive()
OPEN = [fact for fact in played(DRIVE, SCENE) if isinstance(fact, Gesture)]


@settings(max_examples=30, deadline=None)
@given(st.floats(1.0, 9.0), st.floats(0.0, 5.0))
def test_what_a_closed_gate_touches_is_unknown_and_all_else_is_as_ever(closed: float, seconds: float) -> None:
    opened = closed + seconds
    found = answers(played(DRIVE, SCENE, (closed, "inhibit", "arm", "door"), (opened, "allow", "arm", "door")))
    assert len(found) == len(OPEN) == 6
    for before, now in zip(OPEN, found, strict=True):
        if before.onset > opened or before.decided <= closed:
            assert isinstance(now, Gesture) and replace(now, sequence=before.sequence) == before
        else:
            assert isinstance(now, Unknown) and (now.reason, now.gates) == ("inhibited", ("door",))
            assert (now.id, now.onset, now.decided, now.confidence) == (
                before.id, before.onset, before.decided, before.confidence
            )  # fmt: skip
    heard = [event.sequence for event in found if isinstance(event, Gesture)]
    assert heard == list(range(1, len(heard) + 1))


def test_a_sensor_is_silent_while_any_of_its_gates_is_closed() -> None:
    calls = (1.0, "inhibit", None, "door"), (1.2, "inhibit", "arm", "speed"), (1.3, "allow", None, "door")
    facts = played(DRIVE, SCENE, *calls)
    assert reasons(facts) == ["inhibited"] * 6
    assert gates(facts) == [
        ("arm", None, ("door",)), ("seat", None, ("door",)), ("arm", None, ("door", "speed")),
        ("arm", None, ("speed",)), ("seat", None, ()),
    ]  # fmt: skip
    assert not any(isinstance(fact, Decided) for fact in facts), "a seat that moves says nothing of how people touch"


def test_a_gate_for_all_is_closed_for_a_sensor_that_comes_later_and_opens_by_itself() -> None:
    hub = Hub(replace(SCENE, gates=("door",), sensors={"seat": Setup()}), Sure())
    hub.inhibit(None, "wash", 0.0, seconds=3.0)
    assert hub.readings(0.0)["seat"].gate == Gate("seat", None, ("door", "wash"), 3.0, 0.0)
    facts = [fact for t, packet, source in DRIVE for fact in hub.receive([(packet, source)], t)]
    assert [(fact.sensor, fact.closed) for fact in facts if isinstance(fact, Gate)] == [
        ("arm", ("door", "wash")), ("seat", ("door", "wash")), ("arm", ("door",)), ("seat", ("door",)),
    ]  # fmt: skip
    assert hub.allow("arm", "wash", 9.0) == []  # it is open
    (opened,) = hub.allow("arm", "door", 9.0)
    assert isinstance(opened, Gate) and (opened.sensor, opened.closed, opened.until) == ("arm", (), None)
    hub.change(SCENE, Sure(), 9.1)
    assert hub.readings(9.2)["seat"].gate == Gate("seat", None, ("door",), None, 9.2), "it survives a reload"


def test_whoever_asks_is_told_of_a_sensor_of_the_scene_before_it_is_heard() -> None:
    """Its gates stand in `hello`, too: a client that was not told would show it as silent for ever."""
    hub = Hub(replace(SCENE, sensors={"arm": Setup()}, gates=("door",)), Sure())
    assert gates(hub.inhibit("arm", "seat", 1.0, 2.0)) == [("arm", None, ("door", "seat"))]
    assert gates(hub.tick(3.5)) == [("arm", None, ("door",))]
    assert gates(hub.allow(None, "door", 4.0)) == [("arm", None, ())]
    assert not hub.allow(None, "door", 5.0) and not hub.inhibit("seat", "door", 6.0)


@pytest.mark.parametrize("names", [("arm",), ()])
def test_a_reload_without_arming_tells_of_a_sensor_of_the_scene_before_it_is_heard(names: tuple[str, ...]) -> None:
    """Whether or not the configuration still names it."""
    hub = Hub(replace(SCENE, sensors={"arm": Setup()}, arming=Arming("double_tap")), Sure())
    after = replace(SCENE, sensors=dict.fromkeys(names, Setup()))
    assert gates(hub.listening(0.0)) == [("arm", False, ())]
    assert gates(hub.change(after, Sure(), 1.0)) == [("arm", None, ())]
    assert not hub.change(after, Sure(), 2.0)


@pytest.mark.parametrize("armed", [False, None])
def test_a_reload_that_names_a_sensor_or_no_longer_does_tells_of_it_before_it_is_heard(armed: bool | None) -> None:
    before = replace(SCENE, arming=Arming("double_tap") if armed is False else None, gates=("door",))
    hub, after = Hub(before, Sure()), replace(before, sensors={"arm": Setup()})
    assert not hub.listening(0.0)
    assert gates(hub.change(after, Sure(), 1.0)) == [("arm", armed, ("door",))] == gates(hub.listening(1.0))
    assert not hub.change(after, Sure(), 2.0)
    assert gates(hub.change(before, Sure(), 3.0)) == [("arm", None, ())] and not hub.listening(3.0)


def test_whoever_closes_a_gate_again_sets_its_time_anew_for_one_sensor_or_for_all() -> None:
    hub = Hub(replace(SCENE, sensors={"arm": Setup()}), Sure())
    for sensor, seconds in (("arm", 60.0), (None, 1.0), ("arm", math.inf), (None, 9.0)):
        hub.inhibit(sensor, "door", 0.0, seconds)
        assert hub.gates.of("arm") == {"door": seconds}


def test_a_sensor_that_lost_its_place_comes_back_as_silent_as_it_was() -> None:
    hub = Hub(replace(SCENE, max_sensors=1), Sure())
    (_, packet, source) = DRIVE[0]
    hub.receive([(packet, source)], 0.0)
    hub.inhibit("arm", "door", 1.0)
    hub.receive([(stream("seat", Hand(1).idle(0.1), FIRST)[0][1], FIRST)], 100.0)
    assert "arm" not in hub.readings(100.0)
    (new, gate, *_) = hub.receive([(packet, source)], 200.0)
    assert isinstance(new, Changed) and isinstance(gate, Gate) and gate.closed == ("door",)


ARMED = Arming("double_tap", 3.0)


def test_nothing_but_the_gesture_that_arms_counts_until_it_came() -> None:
    found = run(recognizer(Fake([LEFT, NONE, TAPS, LEFT, LEFT]), arming=ARMED), swipes(5))
    assert reasons(found) == ["disarmed", "confidence", "double_tap", "left", "left"]
    assert [event.sequence for event in found if isinstance(event, Gesture)] == [1, 2, 3]
    heard = [event for event in found if isinstance(event, Gesture)]
    told = [event for event in found if isinstance(event, Gate)]
    assert [gate.armed for gate in told] == [True] * 3, "each gesture begins the seconds anew"
    assert [gate.until for gate in told] == [event.decided + 3.0 for event in heard]


@pytest.mark.parametrize(("pause", "answer"), [(2.5, "left"), (3.4, "disarmed")])
def test_the_seconds_run_out_for_what_begins_after_them(pause: float, answer: str) -> None:
    subject = recognizer(Fake([TAPS, LEFT]), arming=ARMED)
    found = run(subject, frames("quiet for 1500ms", SWIPE, f"quiet for {pause}s", SWIPE, "quiet for 900ms"))
    assert reasons(found)[1:] == [answer]
    told = [event.armed for event in found if isinstance(event, Gate)]
    assert told == ([True, True] if answer == "left" else [True, False])


LEAST = st.floats(0.0, 1.0)
UNSURE, BRIEF = says(0.2, 0.5, 0.3), swipes(2)
NAMES = ("one_tap", "double_tap", "left", "right")


def asking(answer: Scores, least: float) -> Scores:
    """An answer of a model whose usual operating point asks for so much of each gesture."""
    return replace(answer, points={"normal": Point(dict.fromkeys(NAMES, least), None, 0, 0, 1)})


@given(LEAST, LEAST, st.dictionaries(st.sampled_from(["double_tap", "left"]), LEAST))
def test_what_follows_the_gesture_that_arms_needs_no_more_than_the_models_threshold(
    least: float, threshold: float, own: dict[str, float]
) -> None:
    told = [replace(asking(each, least), threshold=threshold) for each in (TAPS, UNSURE)]
    found = reasons(run(recognizer(Fake(told), arming=ARMED, thresholds=own), BRIEF))
    arms = float(TAPS.values.max()) >= own.get("double_tap", least)
    heard = arms and own.get("left", min(least, threshold)) <= 0.5
    assert [name for name in found if name in NAMES] == ["double_tap"] * arms + ["left"] * heard


def test_what_follows_the_gesture_that_arms_is_foreseen_as_readily() -> None:
    low, sure = Certainty(1, (0.0,), (0.3,)), asking(foretold("left", 0.97), 0.9)
    unsure = replace(asking(foretold("left", 0.7), 0.9), threshold=0.6)
    seer = Seer(lambda _: unsure if seer.asked > 1 else sure, lambda _: unsure if seer.asked else sure, low)
    said = run(foreseeing(seer, arming=Arming("left", 3.0)), BRIEF)
    assert [one.confidence for one in said if isinstance(one, Provisional)] == pytest.approx([0.7])


def test_time_alone_disarms_a_sensor_that_sends_nothing() -> None:
    hub = Hub(replace(SCENE, arming=Arming("swipe", 3.0)), Sure())
    facts = [fact for t, packet, source in drive(1) for fact in (*hub.receive([(packet, source)], t), *hub.tick(t))]
    facts += [fact for n in range(100) for fact in hub.tick(4.0 + n / 10)]
    assert [(told[0], told[1]) for told in gates(facts)] == [
        ("arm", False),
        ("seat", False),
        ("arm", True),
        ("arm", False),
    ]


def test_a_sensor_may_be_armed_otherwise_than_all_others_and_a_reload_keeps_it_armed() -> None:
    scene = Scene(GESTURES, (9, 9), {"arm": Setup(arming=Arming("swipe", 60.0))}, arming=Arming("double_tap"))
    assert scene.arming_gestures == {"arming.by": "double_tap", "sensors.arm.arming.by": "swipe"}
    hub = Hub(scene, Sure())
    facts = [fact for t, packet, source in DRIVE for fact in hub.receive([(packet, source)], t)]
    assert reasons(facts) == ["swipe"] * 6
    assert hub.change(replace(scene, stale_s=2.0), Sure(), 10.0) == []
    assert [gate.armed for gate in hub.change(SCENE, Sure(), 10.1) if isinstance(gate, Gate)] == [None, None]


@pytest.mark.parametrize("told", [{"by": "left"}, {"by": "double_tap"}, None])
def test_nothing_is_foreseen_where_it_would_not_count(told: dict[str, Any] | None) -> None:
    subject = foreseeing(Seer(), arming=Arming.of(told))
    first, second = (swipes(2)[part] for part in (slice(0, 38), slice(38, None)))
    found = run(subject, first)
    assert len(answers(found)) == 1 and any(isinstance(event, Provisional) for event in found) == (told is None)
    subject.gate({"door": math.inf}, first[-1].t)
    later = run(subject, second)
    assert reasons(later) == ["inhibited"] and not any(isinstance(event, Provisional) for event in later)


def test_a_gate_that_closes_while_a_contact_goes_on_revokes_what_was_foreseen() -> None:
    subject = foreseeing(Seer())
    found: list[Event] = []
    for frame in swipes(1):
        found += run(subject, [frame])
        if any(isinstance(event, Provisional) for event in found):
            found += subject.gate({"door": math.inf}, frame.t)  # type: ignore[arg-type]
    (answer,) = answers(found)
    assert isinstance(answer, Unknown) and (answer.reason, answer.provisional) == ("inhibited", "revoked")


@pytest.mark.parametrize(
    ("settings_", "words"),
    [
        ({"arming": {"by": "left", "seconds": 0}}, "arming.seconds: expected more than 0, at most 3600, found 0.0"),
        ({"arming": {"by": "left", "seconds": math.nan}}, "arming.seconds"),
        ({"arming": {"seconds": 5}}, "arming: expected `by`"),
        ({"arming": ["left"]}, "arming: expected `by`"),
        ({"arming": {"by": "left", "second": 5}}, "arming: expected `by`"),
        ({"gate": {"start": ["a/b"]}}, "gates.start: expected names of A-Z a-z 0-9 _ -, found 'a/b'"),
    ],
)
def test_what_cannot_be_is_named(settings_: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words.replace("/", ".")):
        Scene.from_dict(settings_, GESTURES, (9, 9))


def test_a_replay_has_the_gates_and_the_arming_of_its_tape(tmp_path: Path) -> None:
    """Recorded of a sensor that was armed before, and whose gates an operator closes and opens meanwhile."""
    told = {"arming": {"by": "double_tap", "seconds": 5.0}, "gate": {"start": ["door"]}}
    calls = (0.0, "allow", None, "door"), (2.4, "inhibit", None, "wash"), (3.2, "allow", "arm", "wash")
    facts = played(DRIVE, Scene.from_dict(told, GESTURES, (9, 9)), *calls, armed_until=5.0)
    assert reasons(facts) == ["swipe", "inhibited", "swipe", "swipe", "swipe", "swipe"]
    lines = [json.loads(to_json(fact, 1e9)) for fact in facts if isinstance(fact, Gate)]
    before = {"type": "gate", "sensor": "arm", "armed": True, "closed": [], "until": 1e9 + 5.0, "since": 1e9 - 1.0}
    tape, maker = opened(write(tmp_path / "a.mcap", DRIVE, [before, *lines], **told))
    again = [fact for fact in Replay(tape, maker.scene, Sure()).facts() if isinstance(fact, Gesture | Unknown)]
    assert reasons(again) == reasons(facts)


def test_a_replay_has_the_order_in_which_a_daemon_that_stood_still_served_packets() -> None:
    """It first serves a sensor that came again meanwhile, and closes a gate of `seat` before it serves the packets."""
    hand = Hand(2)
    arm, seat = (stream(name, hand.idle(1.5) + hand.swipe("left") + hand.idle(1.0), FIRST) for name in ("arm", "seat"))
    late = stream("late", hand.idle(1.0), SECOND)
    before, after = sorted(arm[:25] + seat[:25] + late), sorted(arm[25:] + seat[25:])
    before.append((after[-1][0], late[-1][1], SECOND))
    now = before[-1][0]
    hub, facts = Hub(SCENE, Sure()), list[Any]()
    for n, (t, data, source) in enumerate(before + after):
        facts += hub.put("seat", ["door"], now) if n == len(before) else []
        facts += hub.receive([(data, source)], t)
    assert reasons(facts + hub.flush(now + 1.0)) == ["swipe", "inhibited"]
    gate = {"type": "gate", "sensor": "seat", "closed": ["door"], "since": now}
    packets = [Packet(round(1e9 * t), Address(*source), data) for t, data, source in before + after]
    tape = Tape({"settings": {}}, tuple(packets), (gate,), whole=True, told=(len(before),))
    again = [fact for fact in Replay(tape, SCENE, Sure()).facts() if isinstance(fact, Gesture | Unknown)]
    assert reasons(again) == ["swipe", "inhibited"]
