"""The daemon stands still for a while, and its sensors do not."""

import pytest

from tests.hostile.stall import Result, play


def check(result: Result) -> None:
    """Nothing may be made up; nothing may be lost as long as the kernel's buffer held the packets."""
    print(result)
    assert result.violations == [] and result.verdicts["wrong"] + result.verdicts["false"] == 0
    if result.late_s > 0.1:
        pytest.skip(f"this machine is too busy: the sensors were late by {result.late_s:.2f} s")
    if not result.kernel_drops:
        assert result.verdicts["missed"] == result.unknown == 0


def test_a_stall_of_a_second_changes_no_answer(start) -> None:
    daemon = start("--metrics", "127.0.0.1:0", model="cnn_lstm")
    check(play(daemon, 20, 15.0, 1.0, 6.0))


@pytest.mark.hostile
@pytest.mark.parametrize(
    ("sensors", "rate", "stall_s"), [(100, 15.0, 3.0), (20, 15.0, 1.5), (4, 300.0, 1.3), (1, 1000.0, 1.0)]
)
def test_a_stall_changes_no_answer_at_any_rate(start, sensors: int, rate: float, stall_s: float) -> None:
    daemon = start("--metrics", "127.0.0.1:0", "--max-sensors", "100", model="cnn_lstm")
    check(play(daemon, sensors, rate, stall_s, 16.0))


@pytest.mark.hostile
def test_rubbish_that_comes_while_the_daemon_stands_still_makes_no_sensor_silent(start) -> None:
    daemon = start("--metrics", "127.0.0.1:0", model="cnn_lstm")
    check(play(daemon, 20, 15.0, 1.3, 14.0, rubbish=1000))


@pytest.mark.hostile
def test_where_the_kernel_has_no_room_no_gesture_is_made_up(start) -> None:
    """So many packets that the buffer overflows: what was lost is a hole, and the rest is right."""
    daemon = start("--metrics", "127.0.0.1:0", "--max-sensors", "100", model="cnn_lstm")
    result = play(daemon, 30, 100.0, 3.0, 16.0)
    if not result.kernel_drops:
        pytest.skip("the kernel's buffer held everything")
    check(result)
