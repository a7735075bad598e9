"""A day through a front end: what it holds does not grow, and is the same whenever the same frames come."""

from gestured.lab.stability.stiff import day_table


def test_the_same_hours_leave_the_same_behind() -> None:
    (_, frames, after, most, digest), (_, *again) = day_table(quick=True).rows
    assert [frames, after, most, digest] == again
    assert isinstance(after, int) and isinstance(most, int) and 8 * 81 * 5 < after <= most < 50_000
