"""Lines of a daemon that is mad: each fault of a field is found, and nothing that a daemon says is called one."""

import json
from dataclasses import FrozenInstanceError, fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.bridge.counts import Counts
from gestured.bridge.daemon import Daemon
from gestured.client.fields import wrong_field
from gestured.control.listen import readable
from gestured.core.events import (
    Cancelled,
    Gate,
    Gesture,
    Onset,
    Place,
    Provisional,
    Release,
    Status,
    Touch,
    Unknown,
    Where,
)
from gestured.core.messages import gestures_json, hello_json, lost_json, quoted, to_json

WHERE = Where(Place(0.2, 0.5), Place(0.8, 0.5), 0.6, 1e60, 30.0, 1, 0)  # a sensor's counts may be any
SAID = {"model": "m", "degraded": False, "scores": {"one_tap": 0.5}, "where": WHERE}
EVENTS = [
    Onset("a", 1, 1.0),
    Provisional("a", 1, "one_tap", 0.9, 1.0, 1.5),
    Gesture("a", 1, "one_tap", 0.9, 1, 1.0, 1.5, 2.0, 3, 0, **SAID, own=True),
    Unknown("a", 1, 0.3, 1.0, 1.5, 2.0, 3, 0, **SAID),
    Unknown("a", 1, 0.3, 1.0, 1.5, 2.0, 3, 0, **SAID, reason="hole", provisional="revoked"),
    Unknown("a", 1, 0.3, 1.0, 1.5, 2.0, 3, 0, **SAID, reason="inhibited", gates=("door",)),
    Cancelled("a", 1, "held"),
    Release("a", 1, 2.0),
    Gate("a", True, ("door",), 2.5, 2.0),
    Touch("a", 1, 0, "move", 1.5, 0.5, 1.0, -0.01, 0.0, 212.0, 4, "volume"),
    Touch("a", 1, 0, "up", 1.5, 0.5, 0.5, 0.0, 0.0, 1e60, 4, None, "learned"),
    Status("ok", {"a": "ok"}, "m", 2.0),
]
LINES = [
    json.loads(line)
    for line in (
        *(to_json(event, 1.8e9) for event in EVENTS),
        hello_json(
            version="0.1",
            instance="i",
            model="m",
            gestures=["one_tap"],
            sensors={"a": 3},
            gates={"a": {"armed": None, "closed": ["door"], "until": None}},
        ),
        gestures_json(["one_tap"]),
        lost_json(3),
    )
]
ANY = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
)


@pytest.mark.parametrize("line", LINES, ids=lambda line: line["type"])
def test_what_a_daemon_says_is_sound(line):
    assert wrong_field(line) is None
    assert wrong_field(line | {"news": {"of": 2027}}) is None


WRONG = {str: 3, int: "3", float: "soon", bool: 1, list: "one_tap", dict: ["a"], type(None): 3}  # type -> of another


@pytest.mark.parametrize("line", LINES, ids=lambda line: line["type"])
def test_another_type_of_a_field_is_named(line):
    for key in line.keys() - {"protocol"}:  # whoever greets looks at that
        assert (wrong_field(line | {key: WRONG[type(line[key])]}) or "").startswith(f"{key} "), key


def test_a_place_that_is_none_is_named():
    gesture = LINES[2]
    for wrong in ({"start": {"x": 0.5}}, {"end": 0.5}, {"snr": float("nan")}, {"zone": 3}, {"contacts": None}):
        words = wrong_field(gesture | {"where": gesture["where"] | wrong})
        assert words is not None and words.startswith("where {") and "expected an object with start" in words


@pytest.mark.parametrize("kind", ["hello", "status"])
@pytest.mark.parametrize(
    "wrong", [{"closed": 5}, {"closed": [None]}, {"armed": "yes"}, {"until": "soon"}, {"until": 1e11}]
)
def test_what_is_said_of_a_sensors_gates_is_looked_at(kind, wrong):
    line = next(line for line in LINES if line["type"] == kind)
    told = {"armed": None, "closed": ["door"], "until": None}
    assert wrong_field(line | {"gates": {"a": told}}) is None
    assert (wrong_field(line | {"gates": {"a": told | wrong}}) or "").startswith("gates {")


@pytest.mark.parametrize("event", EVENTS, ids=lambda event: type(event).__name__)
def test_an_event_belongs_to_all_that_it_is_told_and_none_of_them_can_change_it(event):
    for one in fields(event):
        with pytest.raises(FrozenInstanceError):
            setattr(event, one.name, None)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 10**400, 1e60, -1e11, True])
def test_a_number_that_is_no_time_is_named(value):
    assert wrong_field(LINES[0] | {"onset": value}) == f"onset {quoted(value)}: expected a number"


@pytest.mark.parametrize("line", [{"type": "news", "sensor": "a"}, LINES[0]], ids=["unknown", "onset"])
def test_a_time_that_a_newer_daemon_says_is_a_time_or_null(line):
    """Whoever reads it may show it, or tell how old the line is."""
    for value in (None, 1.8e9):
        told = line | {"decided": value}
        assert wrong_field(told) is None and "a" in readable(told, {})
        assert Daemon(None, None, Counts("mqtt")).age(told, 1.8e9) == 0.0
    for wrong in ("soon", 10**30, [1]):
        assert (wrong_field(line | {"decided": wrong}) or "").startswith("decided ")


@given(st.sampled_from(LINES), st.dictionaries(st.sampled_from(sorted({key for line in LINES for key in line})), ANY))
def test_any_line_has_an_answer(line, changes):
    words = wrong_field(line | changes)
    assert words is None or len(words) < 200


def test_lines_of_a_newer_and_an_older_daemon_are_sound():
    assert wrong_field({"type": "news", "sensor": "a", "armed": None}) is None
    assert wrong_field({"type": "news", "sensor": 7}) is not None
    (gesture,) = [line for line in LINES if line["type"] == "gesture"]
    assert wrong_field({key: value for key, value in gesture.items() if key not in ("own", "provisional")}) is None
    assert wrong_field({key: value for key, value in gesture.items() if key != "sequence"}) is not None
