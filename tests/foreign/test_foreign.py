"""The judge must be right itself: one seed gives one take, and what is seen moves as its label says."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.foreign import GESTURES, GRIDS, NON_GESTURES, other_grids, session, take


def _path(recording: dict[str, Any]) -> NDArray[np.float64]:
    """(n, 2) centroid as (x, y downward) of the clearly touched frames between onset and release."""
    frames = np.asarray(recording["frames"], dtype=np.float64)
    times = recording["times"]
    idle = frames[times < recording["onset"] - 0.1]
    above = np.clip(frames - np.median(idle, axis=0), 0.0, None)
    strength = above.max(axis=(1, 2))
    above[above < 0.2 * above.max()] = 0.0
    total = above.sum(axis=(1, 2))
    inside = (
        (times > recording["onset"] - 0.05) & (times < recording["release"] + 0.05) & (strength > 0.4 * strength.max())
    )
    rows, columns = np.indices(frames.shape[1:])
    above, total = above[inside], total[inside]
    return np.stack([(above * columns).sum(axis=(1, 2)), (above * rows).sum(axis=(1, 2))], axis=1) / total[:, None]


def _wide(recording: dict[str, Any]) -> float:
    """How wide what presses is: standard deviation of the columns (taxels), the median touched frame's."""
    frames = np.asarray(recording["frames"], dtype=np.float64)
    above = frames - np.median(frames[:15], axis=0)
    strength = above.max(axis=(1, 2))
    above = above[strength > 0.3 * strength.max()]
    seen = np.where(above > 0.2 * above.max(axis=(1, 2), keepdims=True), above, 0.0).sum(axis=1)  # (n, 9)
    columns = np.arange(9)
    total = seen.sum(axis=1)
    mean = (seen @ columns) / total
    return float(np.median(np.sqrt((seen * (columns - mean[:, None]) ** 2).sum(axis=1) / total)))


@pytest.mark.parametrize("level", ["nominal", "hard"])
def test_the_same_seed_gives_the_same_take_and_another_seed_another(level: str) -> None:
    for kind in GESTURES + NON_GESTURES:
        first, again, other = take(kind, 3, level), take(kind, 3, level), take(kind, 4, level)
        assert np.array_equal(first["frames"], again["frames"]) and np.array_equal(first["times"], again["times"])
        assert not np.array_equal(first["frames"][:10], other["frames"][:10])


@pytest.mark.parametrize("kind", GESTURES + NON_GESTURES)
def test_a_take_is_a_finite_recording_with_idle_before_and_after(kind: str) -> None:
    for seed in range(4):
        one = take(kind, seed, "hard")
        times = one["times"]
        assert one["frames"].shape == (len(times), 9, 9) and np.isfinite(one["frames"]).all()
        assert (np.diff(times) > 0).all()
        assert one["onset"] >= 1.3 and times[-1] >= one["release"] + 0.8
        assert one["label"] == (kind if kind in GESTURES else "none")


@pytest.mark.parametrize(
    ("kind", "way"),
    [("swipe_down", (0, 1)), ("swipe_up", (0, -1)), ("swipe_right", (1, 0)), ("swipe_left", (-1, 0))],
)
def test_swipes_move_the_way_that_they_are_called(kind: str, way: tuple[int, int]) -> None:
    for name in [kind, f"{kind}_two_fingers"] if way[1] else [kind]:
        for seed in range(12):
            path = _path(take(name, seed))
            moved = np.polyfit(np.arange(len(path)), path, 1)[0] * (len(path) - 1)
            along = float(moved @ np.array(way))
            assert along > 1.0 and along > 1.5 * abs(float(moved @ np.array(way[::-1])))


@pytest.mark.parametrize(("kind", "sign"), [("circle_clockwise", 1), ("circle_counter_clockwise", -1)])
def test_circles_turn_the_way_that_they_are_called(kind: str, sign: int) -> None:
    for seed in range(12):
        path = _path(take(kind, seed))
        around = np.unwrap(np.arctan2(*(path - (path.min(axis=0) + path.max(axis=0)) / 2).T[::-1]))
        assert sign * np.degrees(around[-1] - around[0]) > 180.0  # y is downward: clockwise is positive


def test_two_fingers_are_two_and_taps_stay() -> None:
    for seed in range(12):
        one = _path(take("one_tap", seed))
        assert len(one) == 0 or np.ptp(one, axis=0).max() < 1.5
        assert _wide(take("swipe_up_two_fingers", seed)) > 0.65


def test_other_grids_have_their_shape_and_rate() -> None:
    for recording, (rows, columns, rate) in zip(other_grids("swipe_left", 1), GRIDS, strict=True):
        assert recording["frames"].shape[1:] == (rows, columns)
        assert 0.9 * rate < 1 / np.median(np.diff(recording["times"])) < 1.1 * rate
        path = _path(recording)
        assert path[-1, 0] < path[0, 0]


def test_a_session_keeps_its_events_apart_and_inside() -> None:
    one = session(5, "nominal", 30.0)
    edges = [t for event in one["events"] for t in (event["onset"], event["release"])]
    assert len(one["events"]) > 5 and edges == sorted(edges) and edges[0] > 1.3 and edges[-1] < one["times"][-1]
