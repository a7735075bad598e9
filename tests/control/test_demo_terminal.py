"""The demo at a terminal: the finger as it moves."""

import re
from contextlib import closing

import pytest

from tests.terminal import Terminal


def pictures(said: str) -> list[list[str]]:
    """What stood there one after the other, without colours."""
    parts = re.split("\x1b\\[\\d*F\x1b\\[J|\x1b\\[J", said)
    return [re.sub("\x1b\\[[0-9;?]*[a-zA-Z]", "", part).splitlines() for part in parts]


@pytest.mark.e2e
def test_the_demo_begins_with_a_circle_that_is_drawn_and_ends_with_what_comes_next(shallow) -> None:
    with closing(
        Terminal("gestured.control", "demo", "--seconds", 8, "--speed", "normal", TMPDIR=str(shallow))
    ) as demo:
        demo.sees("performed   circle_clockwise")
        assert re.search(r"http://127\.0\.0\.1:\d+/#", demo.said)
        drawn = [picture for picture in pictures(demo.said) if any("activity  " in line for line in picture)]
        assert len({"".join(line[2:11] for line in picture[:5]) for picture in drawn}) >= 5  # it goes round
        assert all(len(picture) == 5 and max(map(len, picture)) <= 79 for picture in drawn[:-1])
        demo.sees("gesturectl simulate")
        assert "gestured --" in demo.said and "percentile" not in demo.said
        assert re.search(r"gestures +[1-9]: ", demo.said)
        assert demo.ends() == 0
