"""The segmenter's table: complete, and the same in ARCHITECTURE.md."""

from itertools import pairwise
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from gestured.core.segmenter import (
    CONTACT,
    GAP,
    IDLE,
    RELEASING,
    SPENT,
    TRANSITIONS,
    Action,
    Deed,
    Phase,
    Segmenter,
    Signal,
)

PHASES = {phase.name: phase for phase in (IDLE, CONTACT, RELEASING, GAP, SPENT)}
PAGE = Path(__file__).parents[2] / "ARCHITECTURE.md"
Stream = list[tuple[float, float, tuple[float, float]]]  # s since the frame before, activity in noise, centroid

waits = st.sampled_from([0.001, 1 / 15, 0.11, 0.3, 0.6, 2.0, 6.0])
activities = st.sampled_from([0.0, 2.0, 5.0, 8.0, 50.0, 1000.0])
places = st.sampled_from([(4.0, 4.0), (4.0, 4.5), (0.0, 8.0)])


def deeds(stream: Stream, wait: bool, sure_s: float = 0.0) -> list[Deed]:
    """What a segmenter says of a stream, asked as the front end asks it; no frame is overdue for so many seconds."""
    segmenter = Segmenter(81, 0.15 * 9, wait_for_double_tap=wait)
    t, said = 0.0, list[Deed]()
    for pause, activity, place in stream:
        sure, t = t + sure_s, t + pause
        said += segmenter.wait(t, sure)
        said += segmenter.push(t, activity, place if activity >= segmenter.off else None)
    return said


def table() -> dict[tuple[Phase, Signal], tuple[Phase, Action | None]]:
    """The table of ARCHITECTURE.md."""
    lines = PAGE.read_text().splitlines()
    start = next(n for n, line in enumerate(lines) if line.startswith("| phase |"))
    head, _, *rows = (line.strip("| ").split(" | ") for line in lines[start : lines.index("", start)])
    signals = [Signal[name.replace(" ", "_").upper()] for name in head[1:]]
    found = {}
    for phase, *cells in rows:
        for signal, cell in zip(signals, cells, strict=True):
            if cell != "-":
                target, _, action = cell.partition(", ")
                found[PHASES[phase], signal] = PHASES[target], Action[action.upper()] if action else None
    return found


def test_the_page_shows_the_table() -> None:
    assert table() == {key: (then, action) for key, (then, action, _) in TRANSITIONS.items()}


@given(st.lists(st.tuples(waits, activities, places), max_size=60), st.booleans())
def test_whatever_comes_has_its_row_and_each_onset_its_end(stream: Stream, wait: bool) -> None:
    said = [deed.action for deed in deeds(stream, wait) if deed.action is not Action.RISE]
    after: dict[Action, tuple[Action, ...]] = dict.fromkeys(
        (Action.OPEN, Action.SPLIT), (Action.CLOSE, Action.SPLIT, Action.HELD)
    )
    after[Action.HELD] = (Action.LEFT,)
    assert all(other in after.get(one, (Action.OPEN,)) for one, other in pairwise([Action.LEFT, *said]))
    assert wait or Action.SPLIT not in said  # nothing waits for a second contact, so none is split off


@given(st.lists(st.tuples(waits, activities, places), max_size=60), st.booleans(), st.sampled_from([0.07, 0.11, 1.0]))
def test_when_something_is_decided_changes_nothing_that_is(stream: Stream, wait: bool, sure_s: float) -> None:
    late, soon = deeds(stream, wait), deeds(stream, wait, sure_s)
    assert [deed[:3] for deed in soon] == [deed[:3] for deed in late]
    assert all(deed.offset <= one.decided <= deed.decided for one, deed in zip(soon, late, strict=True))
