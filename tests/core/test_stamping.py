"""When frames were felt: stamps that increase, whatever the network and the sensor's counter do."""

import math
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gestured.core.stamping import Stamp, Stamper
from gestured.core.wire import Arrival

GRID = (3, 4)
P = 1 / 15


def felt(counter: int | None = None, timetag: float | None = None) -> Arrival:
    return Arrival("s", np.zeros(GRID, np.float32), counter, timetag, ())


def stamps(stamper: Stamper, *calls: tuple[float, list[Arrival]]) -> list[Stamp]:
    return [stamp for t, arrivals in calls for stamp in stamper.stamp(arrivals, t)]


def times(got: list[Stamp]) -> list[float]:
    return [s.t for s in got if not s.dropped]


waiting = st.tuples(
    st.floats(0, 12) | st.just(P),
    st.lists(
        st.builds(
            felt, st.none() | st.integers(-5, 40) | st.integers(-(2**31), 2**31 - 1), st.none() | st.floats(0, 60)
        ),
        min_size=1,
        max_size=6,
    ),
)


@given(st.sampled_from(["arrival", "sensor"]), st.lists(waiting, max_size=12), st.floats(0, 1e7))
def test_times_increase_strictly_whatever_is_sent(
    clock: Literal["arrival", "sensor"], calls: list[Any], start: float
) -> None:
    stamper = Stamper(clock)
    got: list[Stamp] = []
    t = start
    for wait, arrivals in calls:
        t += wait
        new = stamper.stamp(arrivals, t)
        assert len(new) == len(arrivals)
        got += new
    at = times(got)
    assert all(a < b for a, b in zip(at, at[1:], strict=False))
    assert all(s.lost >= 0 and math.isnan(s.t) == bool(s.dropped) for s in got)
    if clock == "arrival" and at:
        assert at[-1] <= t + 1e-3  # never ahead of the clock by more than a step for each frame
        assert not any(s.implausible for s in got)


@given(st.lists(st.floats(0.001, 5), min_size=1, max_size=20))
def test_a_frame_that_comes_alone_is_stamped_when_it_arrives(waits: list[float]) -> None:
    stamper = Stamper()
    arrivals = np.cumsum(waits).tolist()
    assert times(stamps(stamper, *[(t, [felt(n)]) for n, t in enumerate(arrivals)])) == arrivals


@pytest.mark.parametrize("counted", [True, False])
def test_frames_held_up_by_a_stall_are_spread_over_it(counted: bool) -> None:
    stamper = Stamper()
    stamps(stamper, *[(n * P, [felt(n if counted else None)]) for n in range(30)])
    late = stamper.stamp([felt(n if counted else None) for n in range(30, 36)], 35 * P)
    assert times(late) == pytest.approx([n * P for n in range(30, 36)])


def test_frames_that_arrive_together_keep_the_gap_of_the_lost_one() -> None:
    stamper = Stamper()
    stamps(stamper, *[(n * P, [felt(n)]) for n in range(30)])
    got = stamper.stamp([felt(30), felt(33), felt(34)], 34 * P)
    assert times(got) == pytest.approx([30 * P, 33 * P, 34 * P])
    assert [s.lost for s in got] == [0, 2, 0]


def test_a_sender_of_pairs_gets_even_times() -> None:
    stamper = Stamper()
    got = stamps(stamper, *[(n * 0.02, [felt(), felt()]) for n in range(30)])
    assert np.diff(times(got))[8:] == pytest.approx(0.01)


def counters(*sent: int, wait: float = P) -> list[str]:
    """What becomes of frames with these counters, one at a time."""
    got = stamps(Stamper(), *[(n * wait, [felt(c)]) for n, c in enumerate(sent)])
    return [s.dropped or ("restart" if s.restarted else f"lost {s.lost}" if s.lost else "ok") for s in got]


@pytest.mark.parametrize(
    ("sent", "expected"),
    [
        ((5, 6, 7), ["ok", "ok", "ok"]),
        ((5, 7, 10), ["ok", "lost 1", "lost 2"]),
        ((5, 5, 6), ["ok", "duplicate", "ok"]),
        ((5, 7, 6, 8), ["ok", "lost 1", "late", "ok"]),
        ((5, 8, 7, 6, 9), ["ok", "lost 2", "late", "late", "ok"]),
        ((2**31 - 1, -(2**31), -(2**31) + 1), ["ok", "ok", "ok"]),
        ((2**31 - 2, -(2**31)), ["ok", "lost 1"]),
        ((900, 0, 1), ["ok", "restart", "ok"]),
        ((5000, 2, 4), ["ok", "restart", "lost 1"]),
        ((10, 0, 1, 2, 3), ["ok", "late", "late", "restart", "ok"]),  # three in a row are no overtaken frames
        ((5, 500_000, 500_001), ["ok", "restart", "ok"]),
        ((5, -(2**31) + 5, -(2**31) + 6), ["ok", "restart", "ok"]),
    ],
)
def test_what_a_counter_says(sent: tuple[int, ...], expected: list[str]) -> None:
    assert counters(*sent) == expected


def test_after_a_pause_a_counter_that_goes_back_is_a_restart_at_once() -> None:
    assert counters(10, 0, 1, wait=1.0) == ["ok", "restart", "ok"]


def test_frames_overtaken_during_a_stall_are_no_restart() -> None:
    stamper = Stamper()
    got = stamps(stamper, (0.0, [felt(1)]), (0.9, [felt(3), felt(2), felt(4)]))
    assert [s.dropped for s in got] == ["", "", "late", ""] and not any(s.restarted for s in got)


def test_a_sensor_without_a_counter_is_never_late() -> None:
    got = stamps(Stamper(), *[(n * P, [felt(c)]) for n, c in enumerate((5, None, 3, None, None))])
    assert all(not s.dropped and not s.lost and not s.restarted for s in got)


def test_the_sensors_clock_counts_at_any_speed() -> None:
    stamper = Stamper("sensor")
    got = stamps(stamper, *[(50 + n * 1e-4, [felt(n, 1000 + n * P)]) for n in range(40)])
    assert times(got) == pytest.approx([50 + n * P for n in range(40)])
    assert not any(s.implausible for s in got)
    assert stamper.at(50 + 39e-4 + 2.0) == pytest.approx(50 + 39 * P + 2.0)


@pytest.mark.parametrize("tag", [990.0, 1000.0, 1010.1, 1e9, None])
def test_an_impossible_time_tag_is_replaced_by_the_arrival(tag: float | None) -> None:
    got = stamps(Stamper("sensor"), (50.0, [felt(timetag=1000.0)]), (50.5, [felt(timetag=tag)]))
    assert times(got) == [50.0, 50.5] and [s.implausible for s in got] == [False, True]


def test_a_frame_that_was_overtaken_is_late_and_moves_no_other_by_the_sensors_clock() -> None:
    """Without a counter its time tag shows it; a clock that was set back is believed after a few frames."""
    order = [n for n in range(60) if n % 12 != 5]
    for n in range(5, 48, 12):
        order.insert(order.index(n + 9) + 1, n)  # comes after nine others
    got = stamps(Stamper("sensor"), *[(50 + i * P, [felt(timetag=1000 + n * P)]) for i, n in enumerate(order)])
    assert [s.dropped == "late" for s in got] == [n % 12 == 5 and i > n for i, n in enumerate(order)]
    assert times(got) == pytest.approx([50 + n * P for i, n in enumerate(order) if n % 12 != 5 or i <= n])
    back = stamps(Stamper("sensor"), *[(50 + n * P, [felt(timetag=1000 + n * P - 0.5 * (n > 9))]) for n in range(30)])
    assert [n for n, s in enumerate(back) if s.dropped] == [10, 11]
    assert times(back) == pytest.approx([50 + n * P for n in range(30) if n not in (10, 11)])


def test_ten_seconds_forward_are_plausible() -> None:
    got = stamps(Stamper("sensor"), (50.0, [felt(timetag=1000.0)]), (50.5, [felt(timetag=1010.0)]))
    assert times(got) == [50.0, 60.0] and not got[1].implausible


def test_packets_that_waited_together_keep_their_own_time_tags() -> None:
    stamper = Stamper("sensor")
    got = stamps(stamper, (50.0, [felt(timetag=1000.0)]), (51.0, [felt(timetag=1000 + x) for x in (0.1, 0.5, 0.6)]))
    assert times(got) == pytest.approx([50.0, 50.1, 50.5, 50.6])


def test_what_this_machine_had_no_room_for_counts_as_lost_where_it_leaves_a_pause() -> None:
    stamper = Stamper()
    stamps(stamper, *[(n * P, [felt()]) for n in range(30)])
    assert stamper.stamp([felt()], 33 * P, missed=True)[0].lost == 3
    assert stamper.stamp([felt()], 34 * P, missed=True)[0].lost == 0  # it was somebody else's
    assert stamper.stamp([felt()], 38 * P)[0].lost == 0  # a pause alone says nothing


def test_a_counter_knows_better_what_was_lost() -> None:
    stamper = Stamper()
    stamps(stamper, *[(n * P, [felt(n)]) for n in range(30)])
    assert stamper.stamp([felt(31)], 35 * P, missed=True)[0].lost == 1


def test_a_sensors_clock_runs_ahead_by_a_day_at_most() -> None:
    stamper = Stamper("sensor")
    got = stamps(stamper, *[(n * P, [felt(timetag=n * Stamper.MAX_STEP_S)]) for n in range(20_000)])
    assert all(stamp.t <= n * P + Stamper.AHEAD_S for n, stamp in enumerate(got))
    assert not got[100].implausible and got[-1].implausible


@given(st.floats(0.001, 0.2), st.floats(0.02, 0.1), st.floats(0, 0.01))
@example(0.04177775799437271, 0.04177775799437271, 0.0)
def test_a_coarse_clock_of_the_sensor_runs_no_faster_than_time(grain: float, period: float, jitter: float) -> None:
    stamper, rng = Stamper("sensor"), np.random.default_rng(0)
    true = np.arange(300) * period
    got = times(
        stamps(
            stamper,
            *[
                (t + jitter * rng.random(), [felt(n, 1e9 + math.floor(t / grain) * grain)])
                for n, t in enumerate(true.tolist())
            ],
        )
    )
    assert got[-1] - got[0] == pytest.approx(true[-1], abs=2 * (grain + period))
