"""From a segment to a net's input: grid, rate and scale, against what simple pictures and signals must give."""

import json
import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gestured.core.frames import Segment
from gestured.core.window import Window

Array = NDArray[np.float64]
Shape = tuple[int, int]

TEXYZ = Window(rows=9, columns=9, rate_hz=15.0, smooth_frames=1, lead_s=1 / 15, tail_s=1 / 15, floor=4.0)
FULL = 1000.0  # counts; as the noise of a segment it makes the scale of a window known


def like(window: Window, **changes: object) -> Window:
    return Window.from_json(json.dumps(json.loads(window.to_json()) | changes))


def whole(frames: Array, times: Array, *, noise: float = 1.0) -> Segment:
    """All frames are touched."""
    return Segment(frames.astype(np.float32), times, 0, len(frames) - 1, noise)


def scaled(window: Window, frames: Array, times: Array) -> Array:
    """What the window makes of the frames, in their own counts (at most `FULL`)."""
    return like(window, floor=1.0).apply(whole(frames, times, noise=FULL)).astype(np.float64) * FULL


seeds = st.integers(0, 2**16)
grids = st.tuples(st.integers(2, 40), st.integers(2, 40))


# --- the model's own sensor


@given(seeds, st.integers(1, 12), st.integers(0, 3), st.integers(0, 3), st.floats(-1, 1))
def test_a_segment_of_the_models_own_sensor_is_only_scaled(
    seed: int, touched: int, lead: int, tail: int, jitter: float
) -> None:
    rng = np.random.default_rng(seed)
    n = lead + touched + tail
    frames = rng.uniform(-20, 500, (n, 9, 9)).astype(np.float32)
    times = (np.arange(n) + 0.05 * jitter * rng.uniform(-1, 1, n)) / 15
    segment = Segment(frames, times, lead, lead + touched - 1, 2.0)
    kept = frames[max(lead - 1, 0) : lead + touched + 1].astype(np.float64)
    kept = np.maximum(kept, 0)
    assert np.array_equal(TEXYZ.apply(segment), (kept / kept.max()).astype(np.float32))


@given(grids, seeds, st.floats(5, 1000), st.integers(1, 30), st.integers(1, 5))
def test_whatever_comes_in_the_window_is_a_picture_of_shares(
    grid: Shape, seed: int, rate: float, n: int, smooth: int
) -> None:
    rng = np.random.default_rng(seed)
    frames = rng.normal(0, 1, (n, *grid))
    frames[n // 2, grid[0] // 2, grid[1] // 2] = 400
    times = np.cumsum(rng.uniform(0.5, 1.5, n)) / rate
    first, last = sorted((n // 2, int(rng.integers(n))))
    window = like(TEXYZ, smooth_frames=smooth).apply(Segment(frames.astype(np.float32), times, first, last, 1e-9))
    assert window.dtype == np.float32 and window.shape[1:] == (9, 9) and len(window) >= 1
    assert np.isfinite(window).all() and window.min() >= 0 and window.max() == 1


@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e30, 3e38])
@pytest.mark.parametrize(("grid", "rate"), [((9, 9), 15.0), ((12, 20), 60.0), ((4, 6), 7.0)])
def test_any_unit_gives_the_same_window(scale: float, grid: Shape, rate: float) -> None:
    rng = np.random.default_rng(1)
    frames, times = rng.uniform(-0.1, 1, (12, *grid)), np.arange(12) / rate
    with np.errstate(over="raise", divide="raise", invalid="raise"):
        other = TEXYZ.apply(whole(frames * scale, times, noise=0.01 * scale))
    assert np.allclose(other, TEXYZ.apply(whole(frames, times, noise=0.01)), atol=1e-6)


# --- scale


@given(st.floats(0.01, 100), st.floats(1, 10))
def test_a_segment_of_noise_is_not_blown_up(noise: float, floor: float) -> None:
    frames = np.zeros((3, 9, 9))
    frames[1, 4, 4] = 0.5 * floor * noise
    window = like(TEXYZ, floor=floor).apply(whole(frames, np.arange(3) / 15, noise=noise))
    assert window.max() == pytest.approx(0.5)
    frames *= 10
    assert like(TEXYZ, floor=floor).apply(whole(frames, np.arange(3) / 15, noise=noise)).max() == 1


@pytest.mark.parametrize("noise", [0.0, 1.0])
@pytest.mark.parametrize(
    ("grid", "value"), [((9, 9), 0.0), ((9, 9), -5.0), ((12, 12), -5.0), ((18, 9), 0.0), ((18, 9), -5.0)]
)
def test_a_segment_without_any_pressure_is_dark(grid: Shape, value: float, noise: float) -> None:
    window = TEXYZ.apply(whole(np.full((3, *grid), value), np.arange(3) / 15, noise=noise))
    assert window.shape == (3, 9, 9) and not window.any()


# --- grid


@given(st.integers(2, 12), st.data(), seeds)
def test_averaging_areas_keeps_the_mean(cells: int, data: st.DataObject, seed: int) -> None:
    side = data.draw(st.integers(cells, 64))
    frames = np.random.default_rng(seed).uniform(0, FULL, (2, side, side))
    found = scaled(like(TEXYZ, rows=cells, columns=cells), frames, np.arange(2) / 15)
    assert found.mean(axis=(1, 2)) == pytest.approx(frames.mean(axis=(1, 2)), rel=1e-5)


def test_areas_of_whole_taxels_are_their_means() -> None:
    frames = np.random.default_rng(0).uniform(0, FULL, (1, 27, 18))
    found = scaled(like(TEXYZ, rows=9, columns=6), frames[:, :18, :], np.arange(1) / 15)
    assert found == pytest.approx(frames[:, :18].reshape(1, 9, 2, 6, 3).mean(axis=(2, 4)), abs=1e-3)


@given(st.integers(2, 8), st.integers(9, 20), *(st.floats(0, 1) for _ in range(3)))
def test_a_coarse_sensor_is_interpolated(side: int, cells: int, base: float, down: float, right: float) -> None:
    """A slope stays the same slope; beyond the outer taxels' centres it is as high as there."""
    taxel = np.arange(side)
    slope = base + down * taxel[:, None] + right * taxel
    found = scaled(like(TEXYZ, rows=cells, columns=cells), slope[None], np.zeros(1))
    at = np.clip((np.arange(cells) + 0.5) * side / cells - 0.5, 0, side - 1)
    assert found[0] == pytest.approx(base + down * at[:, None] + right * at, abs=1e-3)


def centroid(frame: Array) -> tuple[float, float]:
    down, right = frame.sum(axis=1), frame.sum(axis=0)
    return float(down @ np.arange(len(down)) / down.sum()), float(right @ np.arange(len(right)) / right.sum())


@given(st.integers(9, 20), st.floats(1.5, 3), st.booleans(), st.integers(5, 6), st.data())
def test_a_long_sensor_is_not_squeezed(short: int, ratio: float, tall: bool, length: int, data: st.DataObject) -> None:
    """A corner with two legs of the same length in taxels has two legs of the same length in the window."""
    long = round(short * ratio)
    rows, columns = (long, short) if tall else (short, long)
    row, column = (data.draw(st.integers(1, size - length - 2)) for size in (rows, columns))
    path = [(row + k, column) for k in range(length)] + [(row + length, column + k) for k in range(length + 1)]
    frames = np.zeros((len(path), rows, columns))
    for frame, (r, c) in zip(frames, path, strict=True):
        frame[r - 1 : r + 2, c - 1 : c + 2] = FULL / 2
    found = scaled(TEXYZ, frames, np.arange(len(path)) / 15)
    begin, corner, end = (centroid(found[k]) for k in (0, length, 2 * length))
    # A centroid is known to a fraction of a cell; squeezed to 9 x 9 the legs would differ by 0.75 cells and more.
    assert corner[0] - begin[0] == pytest.approx(end[1] - corner[1], abs=0.45)
    assert corner[1] == pytest.approx(begin[1], abs=0.01) and end[0] == pytest.approx(corner[0], abs=0.01)
    assert corner[0] - begin[0] > 0.4 * length


@given(st.integers(9, 16), st.integers(20, 60), st.booleans(), st.data())
def test_the_whole_movement_is_seen_wherever_it_was(short: int, long: int, tall: bool, data: st.DataObject) -> None:
    """Nothing of a movement along a long sensor is cut off: every frame shows the same amount of pressure."""
    begin, end = sorted(data.draw(st.tuples(st.integers(2, long - 3), st.integers(2, long - 3))))
    frames = np.zeros((end - begin + 1, long, short))
    for k, frame in enumerate(frames):
        frame[begin + k - 1 : begin + k + 2, short // 2 - 1 : short // 2 + 2] = FULL / 2
    frames = frames if tall else frames.transpose(0, 2, 1)
    found = scaled(TEXYZ, frames, np.arange(len(frames)) / 15).sum(axis=(1, 2))
    assert found == pytest.approx(found[0], rel=1e-3)


@pytest.mark.parametrize(("grid", "column"), [((30, 10), 0), ((30, 10), 9), ((8, 4), 0), ((8, 4), 3)])
def test_nothing_is_pressed_beside_the_sensor(grid: Shape, column: int) -> None:
    """A swipe along the edge of a long sensor is no broader than one in its middle."""
    rows, columns = grid

    def pressed(at: int) -> float:
        frames = np.zeros((rows, rows, columns))
        for k in range(rows):
            frames[k, k, at] = FULL
        return float(scaled(TEXYZ, frames, np.arange(rows) / 15).sum())

    assert pressed(column) == pytest.approx(pressed(columns // 2), rel=0.01)


# --- rate


def linear(times: Array, seed: int) -> Array:
    """Taxels that rise or fall evenly, 0..FULL; the model's own grid."""
    rng = np.random.default_rng(seed)
    begin, end = rng.uniform(0, FULL, (2, 9, 9))
    share = (times - times[0]) / max(times[-1] - times[0], 1e-9)
    return begin + (end - begin) * share[:, None, None]


def other_rate(rate: float) -> bool:
    return not 0.54 < 15 / rate < 1.13


rates = st.floats(5, 1000).filter(other_rate)
near = st.floats(13.5, 27)  # taken as they are


@given(rates, st.integers(3, 60), st.floats(0, 0.4), seeds)
def test_what_changes_evenly_still_does_at_any_rate(rate: float, frames: int, jitter: float, seed: int) -> None:
    n = max(round(frames / 15 * rate), 3)
    rng = np.random.default_rng(seed)
    times = (np.arange(n) + jitter * rng.uniform(-1, 1, n)) / rate
    assume(
        other_rate(1 / float(np.median(np.diff(times))))
    )  # few frames with much jitter may look like the model's rate
    values = linear(times, seed)
    found = scaled(TEXYZ, values, times)
    assert abs(len(found) - 1 - (times[-1] - times[0]) * 15) <= 0.5 + 1e-5
    at = times[0] + np.arange(len(found)) / 15
    inside = (at >= times[0] + 0.5 / 15) & (at <= times[-1] - 0.5 / 15)
    share = ((at - times[0]) / (times[-1] - times[0]))[:, None, None]
    expected = values[0] + (values[-1] - values[0]) * share
    assert found[inside] == pytest.approx(expected[inside], abs=0.01)


@given(near, st.integers(1, 40), seeds)
def test_a_rate_near_the_models_is_taken_as_it_is(rate: float, n: int, seed: int) -> None:
    frames = np.random.default_rng(seed).uniform(0, FULL, (n, 9, 9))
    assert scaled(TEXYZ, frames, np.arange(n) / rate) == pytest.approx(frames, abs=1e-3)


@given(near | rates, st.integers(12, 40), st.sets(st.integers(1, 38), max_size=3), seeds)
def test_lost_frames_are_filled_in(rate: float, n: int, lost: set[int], seed: int) -> None:
    kept = [k for k in range(n) if k not in lost or k == n - 1]
    times = np.arange(n) / rate
    frames = linear(times, seed)
    full, filled = (scaled(TEXYZ, frames[which], times[which]) for which in (range(n), kept))
    assert len(full) == len(filled)
    assert filled[1:-1] == pytest.approx(full[1:-1], abs=0.01)


@given(st.sampled_from([5.0, 15.0, 40.0, 200.0]), st.integers(0, 20), st.integers(0, 20), seeds)
def test_idle_frames_around_the_gesture_change_nothing(rate: float, before: int, after: int, seed: int) -> None:
    """More quiet context than a window takes makes no difference; it needs `lead_s` and `tail_s` of it."""
    rng = np.random.default_rng(seed)
    context = math.ceil(rate * (1 / 15 + 0.02)) + 1
    core = rng.uniform(0, 500, (2 * context + 6, 9, 9))
    frames = np.concatenate([rng.normal(0, 2, (before, 9, 9)), core, rng.normal(0, 2, (after, 9, 9))])
    times = (np.arange(len(frames)) - before) / rate
    more = Segment(frames.astype(np.float32), times, before + context, before + context + 5, 2.0)
    less = Segment(core.astype(np.float32), times[before : before + len(core)], context, context + 5, 2.0)
    assert np.allclose(TEXYZ.apply(more), TEXYZ.apply(less), atol=1e-6)


@example(38.0, 0, 0.5)  # 7.5 steps long
@given(rates | near, seeds, st.sampled_from([0.5, 1.0, 1 << 20]))
def test_only_differences_of_time_matter(rate: float, seed: int, start: float) -> None:
    frames = np.random.default_rng(seed).uniform(0, FULL, (20, 9, 9))
    times = np.round(np.arange(20) / rate * 2**20) / 2**20
    assert scaled(TEXYZ, frames, times + start) == pytest.approx(scaled(TEXYZ, frames, times), abs=0.1)


@settings(max_examples=30)
@given(st.integers(1, 6), st.integers(1, 12), seeds)
def test_smoothing_is_a_running_mean(length: int, n: int, seed: int) -> None:
    frames = np.random.default_rng(seed).uniform(0, FULL, (n, 9, 9))
    found = scaled(like(TEXYZ, smooth_frames=length), frames, np.arange(n) / 15)
    assert found.shape == frames.shape
    for k in range(n):
        around = [j for j in range(n) if -(length // 2) <= j - k <= (length - 1) // 2]
        assert found[k] == pytest.approx(frames[around].mean(axis=0), abs=1e-3)


# --- as JSON

windows = st.builds(
    Window,
    st.integers(2, 64), st.integers(2, 64), st.floats(0.1, 1000), st.integers(1, 9),
    st.floats(0, 5), st.floats(0, 5), st.floats(0, 100),
)  # fmt: skip


@given(windows)
def test_json_holds_all_of_it(window: Window) -> None:
    assert Window.from_json(window.to_json()) == window


BAD: dict[str, list[object]] = {
    "rows": [1, 1001, 9.0, "9", None, True],
    "columns": [0, -9, 2.5, [9]],
    "rate_hz": [0, -15, 1e9, math.nan, math.inf, "15", True],
    "smooth_frames": [0, 1.5, None],
    "lead_s": [-0.1, math.nan, "0"],
    "tail_s": [-0.1, None],
    "floor": [-1, math.inf, {}],
}


@pytest.mark.parametrize(("key", "value"), [(key, value) for key, values in BAD.items() for value in values])
def test_a_bad_value_is_named(key: str, value: object) -> None:
    with pytest.raises(ValueError, match=f"window: {key}: expected"):
        like(TEXYZ, **{key: value})


@pytest.mark.parametrize("key", sorted(BAD))
def test_a_missing_key_is_an_error(key: str) -> None:
    rest = {k: v for k, v in json.loads(TEXYZ.to_json()).items() if k != key}
    with pytest.raises(ValueError, match=f"window: .*{key}"):
        Window.from_json(json.dumps(rest))


@pytest.mark.parametrize("text", ["", "{", "[]", "9", "null", '"rows"', "[" * 100_000, '{"rows": 9}'])
def test_what_is_no_window_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="^window: expected"):
        Window.from_json(text)


def test_an_unknown_key_is_an_error() -> None:
    with pytest.raises(ValueError, match="^window: expected"):
        like(TEXYZ, colour="red")
