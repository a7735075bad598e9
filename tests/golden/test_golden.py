"""Golden tapes: what the daemon makes of some hours of packets is what it made of them when they were recorded.

`make golden` plays all of them. Where a change is meant, `python -m tests.golden.record` writes the expected lines
anew, and their diff is reviewed.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import pytest

from gestured.model.ladder import Ladder
from tests.golden import expected, path, segments, tape
from tests.golden.path import Line
from tests.golden.real import SESSIONS, real
from tests.golden.tape import GROUPS, Tape
from tests.hostile.grammar import violations

# A replay's times count from the first packet; where that came long after the machine's start, the last bits differ.
REPLAYED_OTHERWISE = {"four sensors"}


@pytest.fixture(scope="module")
def model() -> Iterator[Ladder]:
    """The model that the tapes are pinned to. No run of it is ended, however busy this machine is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gestured.model.limit._hurried", False)
        yield path.open_model()


def some(groups: Iterable[str], long: Iterable[str]) -> list[Any]:
    """Groups as parameters; the long ones are run by `make golden` and `make hostile`."""
    return [pytest.param(group, marks=pytest.mark.hostile if group in long else ()) for group in groups]


def changes(group: str, tapes: list[Tape], kind: str, lines_of: Callable[[Tape], list[Line]]) -> Iterator[str]:
    """What differs, tape by tape."""
    exact = expected.same_machine(group)
    for one in tapes:
        file = expected.path_of(group, one, kind)
        if found := expected.difference(file.read_text(), expected.written(one, lines_of(one)), exact):
            yield f"{group}, {one.name!r} ({file.name}): {found}"


@pytest.mark.parametrize("group", some(GROUPS, {"stalls_long"}))
def test_the_daemon_publishes_the_same_events(group: str, model: Ladder) -> None:
    found = list(changes(group, tape.read(group), "events", lambda one: path.play(one, model)))
    assert not found, "\n".join(found)


@pytest.mark.parametrize("group", some(expected.SEGMENTS, {*expected.SEGMENTS} - {"counters"}))
def test_segments_are_the_same(group: str, model: Ladder) -> None:
    found = list(changes(group, tape.read(group), "segments", lambda one: segments.found(one, model)))
    assert not found, "\n".join(found)


@pytest.mark.hostile
@pytest.mark.skipif(not SESSIONS.exists(), reason=f"there are no recordings of real fingers at {SESSIONS}")
def test_real_fingers_give_the_same_events(model: Ladder) -> None:
    found = list(changes("real", real(), "events", lambda one: path.play(one, model)))
    assert not found, "\n".join(found)


@pytest.mark.parametrize("group", some(GROUPS, {*GROUPS} - {"counters"}))
def test_a_replay_gives_the_events_that_the_daemon_published(group: str, model: Ladder) -> None:
    tapes = tape.read(group)
    otherwise = {one.name for one in tapes if by_sensor(path.replay(one, model)) != by_sensor(path.play(one, model))}
    assert otherwise == {one.name for one in tapes if one.name in REPLAYED_OTHERWISE}


def by_sensor(lines: list[Line]) -> dict[str, list[str]]:
    """Each sensor's events in order, without when they were published."""
    found: dict[str, list[str]] = {}
    for line in events(lines):
        what = {key: value for key, value in line.items() if key != "at"}
        found.setdefault(line["sensor"], []).append(repr(what))
    return found


def events(lines: Iterable[Line]) -> list[Line]:
    """Without what is said of the tape, and the counts at its end."""
    return [line for line in lines if line.get("type", "Counts") not in ("Counts", "Sensor")]


def test_the_tapes_hold_every_answer_and_every_reason() -> None:
    kinds, reasons = set(), set()
    for file in expected.FOLDER.rglob("*.events.jsonl"):
        lines = events(json.loads(line) for line in file.read_text().splitlines())
        kinds |= {line["type"] for line in lines}
        reasons |= {line["reason"] for line in lines if "reason" in line}
        assert violations(line | {"type": line["type"].lower()} for line in lines) == [], file.name
    assert kinds == {"Onset", "Gesture", "Unknown", "Cancelled", "Release"}
    assert reasons == {"held", "silence", "restart", "glitch", "stuck", "refractory"}


EVENT = {"at": 0.1, "type": "Unknown", "confidence": 0.25, "onset": 0.3, "scores": {"one_tap": 0.5}, "looks": "ab"}


@pytest.mark.parametrize(
    ("changed", "here", "elsewhere"),
    [
        ({}, False, False),
        ({"onset": 0.30000000000000004}, True, True),
        ({"type": "Gesture"}, True, True),
        ({"at": 0.2}, True, True),
        ({"more": None}, True, True),
        ({"scores": {"one_tap": 0.5, "double_tap": 0.0}}, True, True),
        ({"scores": {"one_tap": 0.50001}}, True, False),
        ({"scores": {"one_tap": 0.501}}, True, True),
        ({"confidence": 0.25000000000000006}, True, False),
        ({"looks": "cd"}, True, False),
    ],
)
def test_a_difference_is_noticed(changed: Line, here: bool, elsewhere: bool) -> None:
    one, other = (f"{json.dumps(EVENT)}\n{json.dumps(EVENT | more)}\n" for more in ({}, changed))
    assert [expected.difference(one, other, exact) is not None for exact in (True, False)] == [here, elsewhere]


@pytest.mark.parametrize("exact", [True, False])
def test_a_missing_event_and_one_too_many_are_noticed(exact: bool) -> None:
    line = json.dumps(EVENT) + "\n"
    assert "found    no more lines" in (expected.difference(line * 3, line * 2, exact) or "")
    assert "expected no more lines" in (expected.difference(line * 2, line * 3, exact) or "")
    assert "onset: expected 0.3, found 0.4" in (expected.difference(line, line.replace("0.3", "0.4"), exact) or "")
