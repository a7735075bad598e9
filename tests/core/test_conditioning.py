"""What the front end makes of a sensor's levels: baseline, gain, noise, faulty taxels, restarts.

Streams are made here: Gaussian noise on a level, and fingers as Gaussian blobs. Times are written down.
"""

import warnings
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gestured.core.frames import Frame, Segment
from gestured.core.front_end import Cut, Ended, Found, FrontEnd, Opened, Void
from gestured.core.idle import QUIETER
from gestured.core.timing import Timing
from tests.scenario import contacts

Array = NDArray[np.float64]
Shape = tuple[int, int]
Action = tuple[float, Callable[[float], Array] | None]  # seconds, and what is pressed by the share that has passed
Stream = tuple[Array, Array]  # times (n,), frames (n, R, C)

GAIN = 600.0  # counts of a firm finger
ONE = [Opened, Cut, Ended]


def finger(row: float, column: float, shape: Shape, width: float = 0.9) -> Array:
    rows, columns = np.arange(shape[0])[:, None], np.arange(shape[1])
    return GAIN * np.exp(-((rows - row) ** 2 + (columns - column) ** 2) / (2 * width**2))


def quiet(seconds: float) -> Action:
    return seconds, None


def tap(shape: Shape, rate: float = 15.0, at: tuple[float, float] | None = None) -> Action:
    """130 ms, or as long as a sensor of `rate` needs to see two frames of it."""
    row, column = at or ((shape[0] - 1) / 2, (shape[1] - 1) / 2)
    return max(0.13, 2.2 / rate), lambda share: finger(row, column, shape)


def swipe(shape: Shape, *, column: float | None = None, row: float | None = None, seconds: float = 0.8) -> Action:
    """Up along `column`, or to the right along `row`."""
    if row is not None:
        return seconds, lambda share: finger(row, share * (shape[1] - 1), shape)
    assert column is not None
    return seconds, lambda share: finger((1 - share) * (shape[0] - 1), column, shape)


def stream(
    shape: Shape,
    actions: Sequence[Action],
    *,
    rate: float = 15.0,
    seed: int = 0,
    noise: float = 2.0,
    level: float = 300.0,
) -> Stream:
    """The actions one after the other; `noise` and `level` in counts, the level differs by 10 % between taxels."""
    rng = np.random.default_rng(seed)
    ends = np.cumsum([seconds for seconds, _ in actions])
    times: Array = (np.arange(int(ends[-1] * rate), dtype=np.float64) + 0.37) / rate
    frames = level * rng.uniform(0.9, 1.1, shape) + rng.normal(0, noise, (len(times), *shape))
    for t, frame in zip(times, frames, strict=True):
        seconds, pressed = actions[min(int(np.searchsorted(ends, t, side="right")), len(actions) - 1)]
        if pressed is not None:
            begin = ends[np.searchsorted(ends, t, side="right")] - seconds
            frame += pressed((t - begin) / seconds)
    return times, frames


def play(front_end: FrontEnd, times: Array, frames: NDArray[np.generic]) -> list[Found]:
    taken = [Frame(float(t), frame) for t, frame in zip(times, frames, strict=True)]
    return [event for frame in taken for event in contacts(front_end, frame)]


def heard(times: Array, frames: NDArray[np.generic]) -> tuple[FrontEnd, list[Found]]:
    front_end = FrontEnd(*frames.shape[1:])
    return front_end, play(front_end, times, frames)


def kinds(events: list[Found]) -> list[type]:
    return [type(event) for event in events]


def segments(events: list[Found]) -> list[Segment]:
    return [event.segment for event in events if isinstance(event, Cut)]


def told(events: list[Found]) -> list[tuple[object, ...]]:
    """All that the events say but for the counts."""
    found: list[tuple[object, ...]] = []
    for event in events:
        if isinstance(event, Cut):
            s = event.segment
            found.append(("cut", event.decided, s.times.tolist(), s.first, s.last))
        else:
            found.append((event,))
    return found


def follow_rules(events: list[Found]) -> None:
    """Each onset has one answer and one release, but for one that is still open."""
    assert len(events) % 3 < 2
    for number in range(len(events) // 3):
        onset, answer, release = events[3 * number : 3 * number + 3]
        assert isinstance(onset, Opened) and isinstance(answer, Cut | Void) and isinstance(release, Ended)


# --- levels

SHAPE = (9, 9)
GESTURES = [quiet(1.6), tap(SHAPE), quiet(1.2), swipe(SHAPE, column=4), quiet(0.8), swipe(SHAPE, row=2), quiet(0.8)]
seeds = st.integers(0, 9)


@settings(max_examples=20, deadline=None)
@given(seeds, seeds, st.sampled_from([1.0, 100.0, 1e4]))
def test_every_taxel_may_rest_at_a_level_of_its_own(seed: int, other: int, spread: float) -> None:
    times, frames = stream(SHAPE, GESTURES, seed=seed)
    _, events = heard(times, frames)
    assert kinds(events) == 3 * ONE
    constants = np.random.default_rng(other).uniform(-spread, spread, SHAPE)
    _, moved = heard(times, frames + constants)
    assert told(moved) == told(events)
    for one, two in zip(segments(events), segments(moved), strict=True):
        assert np.allclose(one.frames, two.frames, atol=1e-3)
        assert two.noise == pytest.approx(one.noise, rel=1e-3)


@pytest.mark.parametrize("scale", [1e-30, 1e-20, 1e-3, 7.0, 1e20, 1e30])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_the_unit_decides_nothing_and_neither_overflows_nor_underflows(scale: float, kind: type[np.floating]) -> None:
    times, frames = stream(SHAPE, GESTURES)
    _, events = heard(times, frames)
    with np.errstate(all="raise"), warnings.catch_warnings():
        warnings.simplefilter("error")
        _, scaled = heard(times, (frames * scale).astype(kind))
    assert told(scaled) == told(events)
    for one, two in zip(segments(events), segments(scaled), strict=True):
        assert np.allclose(one.frames * scale, two.frames, atol=scale * 1e-2)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.int32, np.float16, np.float32])
def test_any_number_type_will_do(kind: type[np.generic]) -> None:
    times, frames = stream(SHAPE, GESTURES, level=30.0)
    counts = np.rint(frames / 3).clip(0, 255)
    _, events = heard(times, counts)
    assert kinds(events) == 3 * ONE
    _, same = heard(times, counts.astype(kind))
    assert told(same) == told(events)


# --- noise


@pytest.mark.parametrize("rate", [5.0, 15.0, 100.0])
@pytest.mark.parametrize("noise", [0.5, 2.0, 20.0])
@pytest.mark.parametrize("level", [0.0, 1.0, 300.0])  # of the noise: at 0 half of it is cut off
def test_the_noise_is_what_an_idle_taxel_shows(rate: float, noise: float, level: float) -> None:
    for seed in range(3):
        times, frames = stream(SHAPE, [quiet(8)], rate=rate, seed=seed, noise=noise, level=level * noise)
        for counts, step in ((frames, 0.0), (np.maximum(np.rint(frames), 0), 1.0)):
            front_end, events = heard(times, counts)
            shown = float(np.median(counts.std(axis=0)))
            assert events == [] and front_end.bad_taxels == 0
            assert shown / 1.5 < front_end.noise < max(shown, step) * 1.5  # below one step it cannot be known


def test_the_noise_follows_a_sensor_that_becomes_noisier() -> None:
    times, frames = stream(SHAPE, [quiet(150)])
    louder = np.interp(times, [20, 60], [1, 2])[:, None, None]
    level = frames.mean(axis=0)
    front_end, events = heard(times, level + (frames - level) * louder)
    assert events == []
    assert front_end.noise == pytest.approx(4.0, rel=0.25)


@pytest.mark.parametrize("value", [0.0, 300.0, -7.5, 1e30, 1e-30])
def test_a_sensor_that_shows_no_noise_at_all(value: float) -> None:
    """All frames are equal, until somebody taps."""
    times = np.arange(75) / 15
    frames = np.full((75, *SHAPE), value)
    with np.errstate(all="raise"):
        front_end, events = heard(times, frames)
        assert events == [] and front_end.ready and front_end.bad_taxels == 0
        assert 0 < front_end.noise < np.inf
        scale = max(abs(value), 1.0) if abs(value) != 1e-30 else 1e-30
        frames[:2] += scale * finger(4, 4, SHAPE)
        assert kinds(play(front_end, times + 5, frames)) == ONE


def test_one_frame_says_nothing() -> None:
    front_end = FrontEnd(9, 9)
    assert front_end.push(Frame(0.0, np.full((9, 9), 300))) == []
    assert not front_end.ready and not front_end.touched and front_end.rate_hz == 0
    assert front_end.flush(1.0) == [] and front_end.reset() == []


@pytest.mark.parametrize("t", [1.0, 0.5])
def test_time_must_go_on(t: float) -> None:
    front_end = FrontEnd(2, 2)
    front_end.push(Frame(1.0, np.zeros((2, 2))))
    with pytest.raises(ValueError, match="times must increase"):
        front_end.push(Frame(t, np.zeros((2, 2))))


# --- any grid, any rate

RATES = (5.0, 8.0, 12.5, 14.3, 15.0, 30.0, 60.0, 120.0, 250.0, 500.0, 1000.0)
grids = st.tuples(st.integers(2, 64), st.integers(2, 64))
# Large and fast at once costs seconds here; the corners are examples.
sensors = st.tuples(grids, st.sampled_from(RATES)).filter(lambda x: x[0][0] * x[0][1] * x[1] < 60_000)


@settings(max_examples=40, deadline=None)
@example(((2, 2), 1000.0), (0.01, 0.01), True, 1)
@example(((64, 64), 5.0), (0.01, 0.01), True, 1)
@example(((64, 64), 60.0), (0.01, 0.01), True, 1)
@example(((64, 2), 500.0), (0.01, 0.01), True, 1)
@given(sensors, st.tuples(st.floats(0, 1), st.floats(0, 1)), st.booleans(), seeds)
def test_any_sensor_is_ready_in_a_second_and_a_tap_is_one_segment(
    sensor: tuple[Shape, float], place: tuple[float, float], whole: bool, seed: int
) -> None:
    """`place`: shares of its sides."""
    shape, rate = sensor
    at = place[0] * (shape[0] - 1), place[1] * (shape[1] - 1)
    times, frames = stream(shape, [quiet(1.3), tap(shape, rate, at), quiet(1)], rate=rate, seed=seed)
    frames = np.rint(frames) if whole else frames
    front_end = FrontEnd(*shape)
    before = times <= times[0] + 1 + 1 / rate + 1e-9
    assert play(front_end, times[before], frames[before]) == []
    assert front_end.ready
    events = play(front_end, times[~before], frames[~before])
    assert kinds(events) == ONE and not front_end.touched
    (segment,) = segments(events)
    begin, end = 1.3, 1.3 + max(0.13, 2.2 / rate)
    assert begin <= segment.onset <= segment.offset <= end
    assert segment.offset - segment.onset >= end - begin - 2 / rate - 1e-9
    assert front_end.rate_hz == pytest.approx(rate, rel=0.01)


# --- frames that are no sensor's


def rubbish(bits: int, seconds: float, shape: Shape, rate: float, seed: int) -> Array:
    frames: Array = np.random.default_rng(seed).integers(0, 2**bits, (int(seconds * rate), *shape)).astype(np.float64)
    return frames


# A second of nine taxels says little of their noise: of 3 x 3 at 15 Hz one run in some 300 opens a contact by itself.
@settings(max_examples=40, deadline=None)
@given(
    st.tuples(st.integers(4, 16), st.integers(4, 16)), st.sampled_from([8.0, 15.0, 60.0, 200.0]),
    st.sampled_from([8, 12, 16]), st.floats(0.2, 6.0), st.booleans(), seeds,
)  # fmt: skip
def test_what_was_learned_from_rubbish_is_found_out_in_three_seconds(
    shape: Shape, rate: float, bits: int, lasts: float, whole: bool, seed: int
) -> None:
    after = lasts + 3 + 2 * Timing().tap_gap_s  # no contact of these seconds and the tap are one segment
    times, frames = stream(shape, [quiet(after), tap(shape, rate), quiet(1)], rate=rate, seed=seed)
    bad = rubbish(bits, lasts, shape, rate, seed)
    frames[: len(bad)] = bad
    frames = np.rint(frames) if whole else frames
    front_end, events = heard(times, frames)
    follow_rules(events)
    assert segments(events)[-1].onset == pytest.approx(after, abs=1.1 / rate)
    assert front_end.noise < QUIETER * 2.0 and front_end.bad_taxels == 0


def test_after_rubbish_a_sensor_that_stands_still_is_found_out_in_ten_seconds() -> None:
    times, frames = stream(SHAPE, [quiet(11.2), tap(SHAPE), quiet(1)], level=0.0, noise=0.0)
    bad = rubbish(16, 1.2, SHAPE, 15.0, 0)
    frames[: len(bad)] = bad
    front_end, events = heard(times, frames)
    assert segments(events)[-1].onset == pytest.approx(11.2, abs=0.1) and front_end.noise <= 1.0


@pytest.mark.parametrize("repeats", [15, 2])
@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_that_repeats_its_frames_keeps_its_noise(repeats: int, seed: int) -> None:
    """Some, or all for a second each: that is no quieter sensor."""
    times, frames = stream(SHAPE, [quiet(8), tap(SHAPE), quiet(1)], noise=20.0, seed=seed)
    again = np.arange(len(times)) // repeats * repeats
    held = (times > 3) & (times < 7)
    frames[held] = frames[again][held]
    front_end, events = heard(times, frames)
    assert kinds(events) == ONE
    assert front_end.noise == pytest.approx(20.0, rel=0.4)


@pytest.mark.parametrize("rate", [15.0, 30.0, 100.0])
@pytest.mark.parametrize("gap", [0.2, 0.8])
def test_a_taxel_that_is_tapped_alone_again_and_again_is_good(rate: float, gap: float) -> None:
    """Its neighbours show nothing, as on sensors without crosstalk."""

    def poke(share: float) -> Array:
        pressed = np.zeros(SHAPE)
        pressed[4, 4] = GAIN
        return pressed

    times, frames = stream(SHAPE, [quiet(2), *[(0.1, poke), quiet(gap)] * 20, quiet(1)], rate=rate)
    front_end, events = heard(times, frames)
    follow_rules(events)
    assert all(isinstance(event, Opened | Cut | Ended) for event in events) and front_end.bad_taxels == 0


# --- faulty taxels


def faulty(frames: Array, kind: str, at: tuple[int, int], seed: int = 0) -> Array:
    frames = frames.copy()
    if kind == "noisy":
        frames[:, at[0], at[1]] += np.random.default_rng(seed).normal(0, 150, len(frames))
    else:
        frames[:, at[0], at[1]] = {"dead": 0.0, "high": 4095.0, "still": 300.0}[kind]
    return frames


def lies_between_its_neighbours(segment: Segment, at: tuple[int, int]) -> bool:
    row, column = at
    around = segment.frames[:, max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    kept = np.ones(around.shape[1:], dtype=bool)
    kept[min(row, 1), min(column, 1)] = False
    neighbours, own = around[:, kept], segment.frames[:, row, column]
    return bool((neighbours.min(axis=1) - 1e-3 <= own).all() and (own <= neighbours.max(axis=1) + 1e-3).all())


@settings(max_examples=30, deadline=None)
@given(
    st.tuples(st.integers(5, 16), st.integers(5, 16)),
    st.sampled_from(["dead", "high", "still", "noisy"]), st.booleans(), seeds, st.data(),
)  # fmt: skip
def test_a_swipe_over_a_faulty_taxel_is_one_swipe(
    shape: Shape, kind: str, upward: bool, seed: int, data: st.DataObject
) -> None:
    at = data.draw(st.integers(0, shape[0] - 1)), data.draw(st.integers(0, shape[1] - 1))
    over = swipe(shape, column=at[1]) if upward else swipe(shape, row=at[0])
    times, frames = stream(shape, [quiet(1.6), over, quiet(0.8)], seed=seed)
    front_end, events = heard(times, faulty(frames, kind, at, seed))
    assert front_end.bad_taxels == 1
    assert kinds(events) == ONE
    (segment,) = segments(events)
    assert 1.6 <= segment.onset <= 1.75 and 2.25 <= segment.offset <= 2.4
    assert lies_between_its_neighbours(segment, at)


@pytest.mark.parametrize("kind", ["dead", "high", "still"])
def test_a_taxel_that_works_again_is_used_again(kind: str) -> None:
    once = [swipe(SHAPE, column=4), quiet(1)]
    times, frames = stream(SHAPE, [quiet(1.6), *once, quiet(25), *once, *once])
    broken = times < 4
    frames[broken] = faulty(frames[broken], kind, (4, 4))
    front_end = FrontEnd(*SHAPE)
    assert kinds(play(front_end, times[broken], frames[broken])) == ONE and front_end.bad_taxels == 1
    events = play(front_end, times[~broken], frames[~broken])
    assert kinds(events) == 2 * ONE and front_end.bad_taxels == 0
    assert segments(events)[-1].frames[:, 4, 4].max() > 0.9 * GAIN  # its own peak, which its neighbours do not reach


def test_a_taxel_that_becomes_noisy_does_not_end_the_service() -> None:
    """It is found within a minute, whatever it did until then."""
    times, frames = stream(SHAPE, [quiet(70), swipe(SHAPE, row=4), quiet(1)])
    noisy = times >= 3
    frames = np.where(noisy[:, None, None], faulty(frames, "noisy", (4, 4)), frames)
    front_end = FrontEnd(*SHAPE)
    before = times < 63
    follow_rules(play(front_end, times[before], frames[before]))
    assert front_end.bad_taxels == 1
    events = play(front_end, times[~before], frames[~before])
    assert kinds(events) == ONE
    assert lies_between_its_neighbours(segments(events)[0], (4, 4))


@pytest.mark.parametrize("seed", range(3))
def test_a_taxel_that_freezes_under_a_finger_holds_nothing_up(seed: int) -> None:
    over = swipe(SHAPE, column=4)
    actions = [quiet(1.6), over, quiet(4), tap(SHAPE, at=(1, 1)), quiet(6), over, quiet(2)]
    times, frames = stream(SHAPE, actions, seed=seed)
    frozen = (times >= 2.0) & (times < 8.0)  # from the moment when the finger stands on it
    frames[frozen, 4, 4] = frames[frozen][0, 4, 4]
    front_end = FrontEnd(*SHAPE)
    early, late = times < 3.0, times >= 8.0
    events = play(front_end, times[early], frames[early])
    assert kinds(events) == ONE and front_end.bad_taxels == 1
    assert 2.25 <= segments(events)[0].offset <= 2.6  # the finger leaves at 2.4 s
    events = play(front_end, times[~early & ~late], frames[~early & ~late])
    assert kinds(events) == ONE
    assert 6.4 <= segments(events)[0].onset <= segments(events)[0].offset <= 6.53
    events = play(front_end, times[late], frames[late])
    assert kinds(events) == ONE and front_end.bad_taxels == 0
    assert segments(events)[0].frames[:, 4, 4].max() > 0.9 * GAIN


def test_several_faulty_taxels_beside_each_other_are_bridged_from_around_them() -> None:
    times, frames = stream(SHAPE, [quiet(1.6), swipe(SHAPE, column=4), quiet(1)])
    frames[:, 3:5, 4:6] = 0.0
    front_end, events = heard(times, frames)
    assert front_end.bad_taxels == 4 and kinds(events) == ONE
    (segment,) = segments(events)
    ring = segment.frames[:, 2:6, 3:7].reshape(-1, 16)
    inside = segment.frames[:, 3:5, 4:6].reshape(-1, 4)
    outside = np.delete(ring, [5, 6, 9, 10], axis=1)
    assert (inside.max(axis=1) <= outside.max(axis=1) + 1e-3).all()
    assert (inside.min(axis=1) >= outside.min(axis=1) - 1e-3).all()


# --- what a day brings


@settings(max_examples=25, deadline=None)
@given(st.tuples(st.floats(1, 7), st.floats(1, 7)), st.floats(0.2, 4.0), st.floats(0.8, 2.5), seeds)
def test_a_hand_at_the_start_is_no_baseline_for_ever(
    at: tuple[float, float], rests: float, width: float, seed: int
) -> None:
    """A second after it was let go the sensor is ready, and the place where the hand lay works like any other."""
    hand = rests, lambda share: finger(*at, SHAPE, width)
    times, frames = stream(SHAPE, [hand, quiet(1.1), tap(SHAPE, at=at), quiet(1)], seed=seed)
    front_end = FrontEnd(*SHAPE)
    gone = times < rests + 1.1
    assert play(front_end, times[gone], frames[gone]) == []
    assert front_end.ready
    events = play(front_end, times[~gone], frames[~gone])
    assert kinds(events) == ONE
    assert segments(events)[0].frames.max() > 0.8 * GAIN * np.exp(-0.5 / (2 * 0.9**2))


@pytest.mark.parametrize("faint", [0.025, 0.03, 0.04])
@pytest.mark.parametrize("seed", range(3))
def test_a_swipe_beside_what_lies_there_faintly_is_a_segment_of_its_own(faint: float, seed: int) -> None:
    """An arm has shifted: its edge presses too faintly for a gesture, and too strongly for an idle sensor."""
    edge = faint * finger(1, 1, SHAPE)
    lies: Action = (0.8, lambda share: edge)
    swiped: Action = (0.4, lambda share: finger(7 - 6 * share, 6, SHAPE) / 4 + edge)
    _, events = heard(*stream(SHAPE, [quiet(2), lies, swiped, lies, quiet(1)], seed=seed))
    (found,) = segments(events)
    assert 2.75 < found.onset < 2.95 and 3.1 < found.offset < 3.3
    follow_rules(events)


@pytest.mark.parametrize("trembles", [0.02, 0.05, 0.1, 0.2])
def test_something_narrow_that_trembles_is_learned_in_ten_seconds(trembles: float) -> None:
    """The corner of a bag in a vehicle: it never lies still for a second, and must not keep the sensor deaf."""
    rng = np.random.default_rng(1)

    def corner(share: float) -> Array:
        row, column = rng.normal(0, trembles / 2, 2)
        return 0.4 * (1 + trembles * rng.normal()) * finger(6 + row, 1.5 + column, SHAPE)

    swiped: Action = (0.4, lambda share: finger(7 - 6 * share, 6.5, SHAPE) + corner(share))
    _, events = heard(*stream(SHAPE, [quiet(2), (11.0, corner), swiped, (1.5, corner)]))
    assert kinds(events)[:3] == [Opened, Void, Ended] and segments(events)[-1].onset == pytest.approx(13.0, abs=0.15)
    assert segments(events)[-1].offset == pytest.approx(13.4, abs=0.15)


@pytest.mark.parametrize("turns", [4, 10, 20])
def test_a_finger_that_goes_on_moving_is_never_learned(turns: int) -> None:
    """A slider: however long it takes, one contact."""
    moves: Action = (20.0, lambda share: finger(4, 4 + 3 * np.sin(2 * np.pi * turns * share), SHAPE))
    _, events = heard(*stream(SHAPE, [quiet(2), moves, quiet(2), tap(SHAPE), quiet(1)]))
    assert kinds(events) == [Opened, Void, Ended, *ONE] and events[2].offset == pytest.approx(22.0, abs=0.15)


@settings(max_examples=40, deadline=None)
@given(st.floats(2.0, 4.0), st.sampled_from([0.0, 50.0, 250.0, 350.0, 600.0, 2000.0]), seeds)
def test_a_restart_with_another_baseline_at_any_moment(moment: float, level: float, seed: int) -> None:
    """Idle, under a finger or in a gap: what is open has its answer, and a second later things work again."""
    actions = [quiet(2.5), swipe(SHAPE, column=4), quiet(0.5), tap(SHAPE), quiet(9)]
    times, frames = stream(SHAPE, actions, seed=seed)
    other = level + np.random.default_rng(seed).uniform(0, 30, SHAPE)
    after = times >= moment
    level_before = np.median(frames[times < 2.5], axis=0)
    frames[after] += other - level_before
    front_end, events = heard(times, frames)
    follow_rules(events)
    assert front_end.ready and not front_end.touched and front_end.bad_taxels == 0
    more, again = stream(SHAPE, [quiet(0.2), swipe(SHAPE, row=4), quiet(1)], seed=seed)
    again += other - np.median(again[more < 0.2], axis=0)
    events = play(front_end, more + times[-1] + 0.01, again)
    assert kinds(events) == ONE
    assert segments(events)[0].frames.max() > 0.8 * GAIN


@settings(max_examples=30, deadline=None)
@example(1, 1, 2000.0, 0)
@example(1, 9, 2000.0, 0)
@example(3, 1, 2000.0, 0)
@given(st.sampled_from([1, 2, 3]), st.integers(13, 81), st.floats(40, 5000), seeds)
def test_negative_bursts_are_no_touch(length: int, taxels: int, depth: float, seed: int) -> None:
    """Eight quiet seconds with three bursts, each on taxels of its own; then a tap."""
    times, frames = stream(SHAPE, [quiet(8), tap(SHAPE), quiet(1)], seed=seed, level=depth)
    rng = np.random.default_rng(seed)
    flat = frames.reshape(len(frames), -1)
    for begin in (40, 55, 70):
        flat[begin : begin + length, rng.permutation(81)[:taxels]] -= depth
    _, events = heard(times, frames)
    assert kinds(events) == ONE and 8 <= segments(events)[0].onset <= 8.13


@pytest.mark.parametrize("frames_later", [3, 8, 14])
def test_a_taxel_that_reads_zero_once_after_a_contact_is_no_touch(frames_later: int) -> None:
    swiped = [quiet(2), swipe(SHAPE, column=4), quiet(12), tap(SHAPE), quiet(1)]
    times, frames = stream(SHAPE, swiped, level=2000, noise=4)
    frames[np.searchsorted(times, 2.9) + frames_later, 7, 7] = 0
    _, events = heard(times, frames)
    assert kinds(events) == 2 * ONE


def test_a_negative_burst_does_not_cut_a_swipe_in_two() -> None:
    times, frames = stream(SHAPE, [quiet(1.6), swipe(SHAPE, column=4, seconds=1), quiet(1)])
    hit = int(np.searchsorted(times, 2.1))
    frames[hit] -= 1000
    _, events = heard(times, frames)
    assert kinds(events) == ONE
    (segment,) = segments(events)
    assert times[hit] not in segment.times and segment.offset - segment.onset > 0.85


# --- extremes


@pytest.mark.parametrize(("value", "hours"), [(300.0, 0.1), (0.0, 7.0)])  # then 1 / noise would overflow
def test_a_sensor_that_stood_still_for_long_hears_no_single_count(value: float, hours: float) -> None:
    """Clipped sensors show no noise for hours: it is not known to be nothing."""
    front_end = FrontEnd(*SHAPE)
    times = np.concatenate([np.arange(20) / 15, 1.34 + np.arange(int(hours * 3600 / 0.9)) * 0.9])
    frames = np.full((len(times), *SHAPE), value)
    with np.errstate(all="raise"):
        assert play(front_end, times, frames) == []
        frames[:2, 4, 4] += 1.0
        assert play(front_end, times[:30] + times[-1] + 0.1, frames[:30]) == []
        assert 0.3 < front_end.noise < 1.0
        frames[:2] += finger(4, 4, SHAPE)
        assert kinds(play(front_end, times[:30] + times[-1] + 30.0, frames[:30])) == ONE


@pytest.mark.parametrize("gain", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_a_clipped_sensor_may_have_any_unit(gain: float) -> None:
    """It shows nothing at all until somebody touches it, so that only the touch tells its unit."""
    times, frames = stream(SHAPE, GESTURES, level=0.0, noise=0.0)
    counts = np.rint(frames) * gain
    _, events = heard(times, counts)
    assert kinds(events) == 3 * ONE
    if gain <= 1:  # whole numbers are taken to count in ones
        _, softly = heard(times, np.where(counts > 0, gain, 0.0))  # never more than one count
        assert softly == []


@pytest.mark.parametrize("least", [5e-324, 1e-310, 1e-45])
def test_the_least_of_all_changes_is_no_unit(least: float) -> None:
    times, frames = stream(SHAPE, GESTURES, level=0.0, noise=0.0)
    frames[20, 4, 4] = least  # nothing before it
    with np.errstate(all="raise", under="ignore"), warnings.catch_warnings():
        warnings.simplefilter("error")
        front_end, events = heard(times, frames)
    assert kinds(events) == 3 * ONE
    assert 0.0 < front_end.noise < 1.0


@pytest.mark.parametrize("size", [1e4, 1e6, 1e12, 1e30, -1e12])
@pytest.mark.parametrize("taxels", [1, 81])
@pytest.mark.parametrize("moment", [0.4, 1.4, 2.4])  # while it settles, in idle, in a gesture
def test_one_spike_is_forgotten(size: float, taxels: int, moment: float) -> None:
    """One odd number must not make a sensor deaf: where it is one taxel's, touches count within three seconds."""
    where, pause = (slice(31, 32), 3.0 if moment > 1.0 else 10.0) if taxels == 1 else (slice(81), 10.0)
    times, frames = stream(SHAPE, [quiet(2), swipe(SHAPE, row=4), quiet(pause), *GESTURES])
    frames[np.searchsorted(times, moment)].reshape(-1)[where] += size
    with np.errstate(all="raise"):
        front_end, events = heard(times, frames)
    follow_rules(events)
    late = [event for event in events if isinstance(event, Cut) and event.segment.onset > times[-1] - 8.0]
    assert len(late) == 3
    assert front_end.noise == pytest.approx(2.0, rel=0.3)


@pytest.mark.parametrize("left", [0.05, -0.05])
@pytest.mark.parametrize("seed", range(3))
def test_what_a_contact_leaves_behind_is_no_touch(left: float, seed: int) -> None:
    """Textile comes back slowly, or swings below its baseline: here within half a second, from a share of the peak."""
    times, frames = stream(SHAPE, [quiet(2), swipe(SHAPE, column=4), quiet(6), tap(SHAPE), quiet(1)], seed=seed)
    after = np.maximum(times - 2.8, 0.0)
    pressed = sum(finger(row, 4, SHAPE) for row in range(9))
    frames += (left * np.exp(-after / 0.5) * (after > 0))[:, None, None] * pressed
    front_end, events = heard(times, frames)
    assert kinds(events) == 2 * ONE and not front_end.touched
    assert segments(events)[0].offset < 3.3 and 8.8 <= segments(events)[1].onset
