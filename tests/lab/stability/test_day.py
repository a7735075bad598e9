"""A day through a front end: what it holds does not grow, and is the same whenever the same frames come."""

import numpy as np

from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.lab.stability.day import day, day_table, held


def test_the_same_hours_leave_the_same_behind() -> None:
    (_, frames, after, most, digest), (_, *again) = day_table(quick=True).rows
    assert [frames, after, most, digest] == again
    assert isinstance(after, int) and isinstance(most, int) and 81 * 5 < after <= most < 10_000


def test_the_least_change_of_what_was_learned_is_held() -> None:
    front_end = FrontEnd(9, 9)
    for frame, _ in zip(day(quick=True).frames, range(100), strict=False):
        front_end.push(frame)
    before = list(held(front_end))
    assert before == list(held(front_end))
    counts = front_end.conditioner.idle.counts
    counts[40] = np.nextafter(counts[40], np.inf)
    changed = [one for one, other in zip(before, held(front_end), strict=True) if one != other]
    assert len(changed) == 1
    front_end.push(Frame(100.0, np.zeros((9, 9))))
    assert before != list(held(front_end))
