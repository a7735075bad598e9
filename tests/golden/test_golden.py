"""Golden tapes: what the daemon makes of some hours of packets is what it made of them when they were recorded.

Where that is meant to change, `python -m tests.golden.record` writes the expected lines anew, and their diff is reviewed.
"""

from collections.abc import Callable, Iterator

import pytest

from gestured.ladder import Ladder
from tests.golden import expected, path, segments, tape
from tests.golden.groups import GROUPS
from tests.golden.path import Line
from tests.golden.tape import Tape

LONG = {"stalls_long", "rubbish", "settings", "clock_sensor", "one_shot"}
NOT_IN_A_REPLAY: dict[str, str] = {}


@pytest.fixture(scope="module")
def model() -> Ladder:
    return path.open_model()


def changes(group: str, tapes: list[Tape], kind: str, lines_of: Callable[[Tape], list[Line]]) -> Iterator[str]:
    """What differs, tape by tape."""
    exact = expected.same_machine()
    for one in tapes:
        file = expected.path_of(group, one, kind)
        if found := expected.difference(file.read_text(), expected.written(one, lines_of(one)), exact):
            yield f"{group}, {one.name!r} ({file.name}): {found}"


@pytest.mark.parametrize("group", GROUPS)
def test_the_daemon_publishes_the_same_events(group: str, model: Ladder) -> None:
    found = list(changes(group, tape.read(group), "events", lambda one: path.play(one, model)))
    assert not found, "\n".join(found)


@pytest.mark.parametrize("group", expected.SEGMENTS)
def test_segments_are_the_same(group: str, model: Ladder) -> None:
    found = list(changes(group, tape.read(group), "segments", lambda one: segments.found(one, model)))
    assert not found, "\n".join(found)
