"""What no sensor should send, through the very code that the daemon runs: does anything not finite come out?

Windows, features and models are given segments; the whole path is given streams of a finger that swipes to the
right. Every warning counts as a fault.
"""

import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from gestured.core.events import Event, Gesture, Onset
from gestured.core.features import touch_pattern
from gestured.core.frames import Frame, Segment
from gestured.core.front_end import FrontEnd
from gestured.core.recognizer import Classifier, Recognizer, events_of
from gestured.core.window import Window
from gestured.lab.dataset import WINDOW
from gestured.lab.stability.path import Array, Series, events, fault, labels
from gestured.lab.stability.table import Table, Value
from gestured.model.model import Model

SIGNAL, NOISE, IDLE_LEVEL = 600.0, 2.0, 300.0  # counts of a firm finger, of noise, of an idle taxel
# The largest numbers of float32, one that its square overflows, ordinary ones, two denormals, and both zeros.
FINITE = (float(np.finfo(np.float32).max), 1e30, 1.0, 1e-40, 1e-45, 0.0, -0.0, -1e-40, -1.0, -1e30)
WINDOWS = (
    WINDOW,
    Window(9, 9, 15.0, 3, 1 / 15, 1 / 15, 4.0),
    Window(5, 7, 60.0, 1, 1 / 15, 1 / 15, 4.0),
    Window(27, 15, 5.0, 1, 1 / 15, 1 / 15, 0.0),
)
FOUND = "swipe_right"  # what all swipes of `swipes` are
LEAST_GRID = 3  # on 2 x 2 taxels a swipe is two taps


@dataclass(frozen=True, slots=True)
class Case:
    """A stream, and the times (s) of the swipes of which each must be found; `alone`: and nothing else."""

    family: str
    stream: Series
    swipes: tuple[float, ...] = ()
    alone: bool = False


def finger(row: float, column: float, rows: int, columns: int, width: float) -> Array:
    """(R, C) counts."""
    down, right = np.ogrid[:rows, :columns]
    return np.asarray(SIGNAL * np.exp(-((down - row) ** 2 + (right - column) ** 2) / (2 * width**2)))


def swipes(
    count: int, *, shape: tuple[int, int] = (9, 9), rate: float = 15.0, noise: float = NOISE, level: float = IDLE_LEVEL
) -> tuple[Series, tuple[float, ...]]:
    """So many swipes of 0.7 s to the right, 3.7 s apart, the first at 1.5 s; and when they begin."""
    rng = np.random.default_rng(len(shape) * count)
    times = np.arange(int(count * 3.7 * rate)) / rate
    share = (times % 3.7 - 1.5) / 0.7
    frames = level + noise * rng.standard_normal((len(times), *shape))
    size = max(min(shape) / 9, 0.6)
    for k in np.flatnonzero((share >= 0) & (share <= 1)):
        frames[k] += finger((shape[0] - 1) / 2, (0.1 + 0.8 * share[k]) * (shape[1] - 1), *shape, size)
    return Series(times, frames), tuple(1.5 + 3.7 * k for k in range(count))


def segment_cases(quick: bool) -> Iterator[tuple[str, Segment]]:
    """Segments at and beyond what a front end gives: (family, segment)."""
    rng = np.random.default_rng(2)
    times = np.arange(12) / 15 + 5.0
    base = np.array([finger(4, 0.7 * k, 9, 9, 1.0) for k in range(12)]) + NOISE * rng.standard_normal((12, 9, 9))

    def made(frames: Array, at: Array = times, noise: float = NOISE) -> Segment:
        return Segment(np.asarray(frames, np.float32), at[: len(frames)], 0, len(frames) - 1, noise)

    for power in range(-45, 36, 5):
        for noise in (10.0**power, 0.0, 1e-300, 1e300):
            yield "scale 1e-45 to 1e35, any noise", made(base * 10.0**power, noise=noise)
    for offset in (1e4, 1e5, 1e6, 1e7):
        yield "offset 1e4 to 1e7 times the signal", made(base + offset * SIGNAL)
    for value in FINITE:
        for noise in (NOISE, 0.0):
            yield "constant, one frame, denormal, -0.0", made(np.full((12, 9, 9), value), noise=noise)
            yield "constant, one frame, denormal, -0.0", made(np.full((1, 9, 9), value), noise=noise)
    for taxel in range(0, 81, 9 if quick else 1):
        for value in (SIGNAL, FINITE[0]):
            yield "one active taxel", made(value * np.eye(81)[[taxel] * 12].reshape(12, 9, 9))
    signs = np.where(np.indices((12, 9, 9)).sum(axis=0) % 2, 1.0, -1.0)
    for value in (1.0, SIGNAL, 1e30, FINITE[0]):
        yield "alternating extremes", made(value * signs)
        yield "alternating extremes", made(value * np.maximum(signs, 0.0))
    for count in (1, 2, 3, 10, 100, 1000, *(() if quick else (10_000,))):
        for rate in (5, 15, 60, 1000):
            long = np.array([finger(4, 8 * k / count, 9, 9, 1.0) for k in range(count)])
            yield "1 to 10,000 frames at 5 to 1000 Hz", made(long, np.arange(count) / rate)
    for shape in ((2, 2), (2, 64), (64, 2), (3, 5), (27, 15), (64, 64)):
        moved = np.array([finger(shape[0] / 2, shape[1] * k / 12, *shape, 1.0) for k in range(12)])
        for frames in (moved, -moved, 0.0 * moved, 0.0 * moved + FINITE[0]):
            yield "2 x 2 to 64 x 64", made(frames)


def broken_segments(quick: bool) -> Iterator[tuple[str, Segment]]:
    """What is not finite, at each place of three frames."""
    for place in range(0, 3 * 81, 9 if quick else 1):
        for value in (np.nan, np.inf, -np.inf):
            frames = np.zeros(3 * 81, np.float32)
            frames[:81] = SIGNAL
            frames[place] = value
            yield "NaN, infinity at each position", Segment(frames.reshape(3, 9, 9), np.arange(3) / 15, 0, 2, NOISE)


def streams(quick: bool) -> Iterator[Case]:
    """Streams for the whole path."""
    base, at = swipes(2)
    few = 9 if quick else 1
    for power in (*range(-30, 31, 15 if quick else 5), -3, -2, -1, 1, 2, 3):
        for kind in (np.float32, np.float64):
            yield Case(
                "scale 1e-30 to 1e30", Series(base.times, (base.frames * 10.0**power).astype(kind)), at, alone=True
            )
    clipped = Series(base.times, np.rint(np.maximum(swipes(2, noise=0.0, level=0.0)[0].frames, 0.0)))
    for power in range(-6, 7, 3):
        yield Case("scale of a sensor without noise", Series(base.times, clipped.frames * 10.0**power), at, alone=True)
    for offset in (1.0, 1e2, 1e4):
        for kind in (np.float32, np.float64):
            shifted = (base.frames + offset * SIGNAL).astype(kind)
            yield Case("offset up to 1e4 times the signal", Series(base.times, shifted), at, alone=True)
    for offset in (1e5, 1e6, 1e7):
        yield Case("offset up to 1e7: finite", Series(base.times, (base.frames + offset * SIGNAL).astype(np.float32)))
    for shape in ((2, 2), (9, 9), (64, 64)):
        for value in FINITE:
            yield Case(
                "constant signals: nothing", Series(np.arange(60) / 15, np.full((60, *shape), value)), alone=True
            )
    yield Case("one frame: nothing", Series(base.times[:1], base.frames[:1]), alone=True)
    touched = (base.times % 3.7 >= 1.5) & (base.times % 3.7 <= 2.0)
    for taxel in range(0, 81, few):
        frames = base.frames.copy().reshape(-1, 81)
        frames[touched, taxel] += SIGNAL
        yield Case("one active taxel", Series(base.times, frames.reshape(base.frames.shape)))
    for value in (4095.0, 65535.0, FINITE[0]):
        yield Case("all saturated, all equal", _with(base, touched, value))
    for value in (1.0, 1e3, 1e30):
        signs = np.where(np.indices(base.frames.shape).sum(axis=0) % 2, value, -value)
        yield Case("alternating extremes", Series(base.times, signs))
        yield Case("alternating extremes", Series(base.times, np.where(touched[:, None, None], signs, base.frames)))
    for count in (1, 2, 3, 10, 100, 1000, *(() if quick else (10_000,))):
        yield Case("touched for 1 to 10,000 frames at 1000 Hz", _held(count))
    for rate in (5.0, 10.0, 30.0, 100.0, 250.0, *(() if quick else (1000.0,))):
        yield Case("5 to 1000 Hz", *swipes(2, rate=rate), alone=True)
    for shape in ((2, 2), (3, 3), (5, 9), (9, 9), (27, 15), (64, 64)):
        stream, when = swipes(2, shape=shape)
        yield Case("2 x 2 to 64 x 64", stream, when if min(shape) >= LEAST_GRID else ())
    for frames in (base.frames * 1e-310, (base.frames * 1e-40).astype(np.float32)):
        yield Case("denormals", Series(base.times, frames))
    yield Case("-0.0 for 0", Series(base.times, np.where(clipped.frames == 0, -0.0, clipped.frames)), at, alone=True)
    for place in range(0, 81, few):
        for value in (np.nan, np.inf, -np.inf):
            for moment in (0.5, 1.2, 1.8):
                frames = base.frames.copy()
                frames[int(moment * 15)].reshape(-1)[place] = value
                yield Case("NaN, infinity at each position", Series(base.times, frames), at, alone=True)
    yield from _steps_and_spikes()


def _steps_and_spikes() -> Iterator[Case]:
    long, at = swipes(5)
    for step, bounded_s in ((1e3, 13.0), (1e-3, 3.0)):
        frames = long.frames.copy()
        frames[int(1.85 * 15) :] *= step
        after = tuple(t for t in at if t > 1.85 + bounded_s)
        yield Case("gain step of 1000 in mid-gesture, 13 s later", Series(long.times, frames), after)
    for size in (1e6, 1e12, -1e12, 1e30):
        for moment in (0.5, 1.2, 1.8):
            for taxels in (1, 81):
                frames = long.frames.copy()
                frames[int(moment * 15)].reshape(-1)[:taxels] = size
                after = tuple(t for t in at if t > moment + 8.0)
                yield Case("one spike of 1e6 to 1e30, 8 s later", Series(long.times, frames), after)


def _with(base: Series, touched: Array, value: float) -> Series:
    return Series(base.times, np.where(touched[:, None, None], value, base.frames))


def _held(count: int) -> Series:
    times = np.arange(1500 + count + 1000) / 1000
    frames = IDLE_LEVEL + NOISE * np.random.default_rng(count).standard_normal((len(times), 9, 9))
    frames[1500 : 1500 + count] += finger(4, 4, 9, 9, 1.0)
    return Series(times, frames)


def swipes_found(case: Case, classifier: Classifier) -> tuple[int, str]:
    """(how many of the swipes were found, what is wrong otherwise)."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = events(case.stream, classifier)
        except (Warning, ArithmeticError, ValueError) as error:
            return 0, f"{type(error).__name__}: {error}"
    wrong = fault(found)
    if case.alone and len(labels(found)) != len(case.swipes):
        wrong = wrong or f"answered {', '.join(labels(found)) or 'nothing'}"
    named = [event.onset for event in found if isinstance(event, Gesture) and event.gesture == FOUND]
    return sum(any(abs(onset - at) < 0.5 for onset in named) for at in case.swipes), wrong


def whole_path_table(classifier: Classifier, quick: bool) -> Table:
    """Each family of streams: how many swipes were found, and what went wrong."""
    kept: dict[str, list[tuple[int, int, str]]] = {}
    for case in streams(quick):
        kept.setdefault(case.family, []).append((len(case.swipes), *swipes_found(case, classifier)))
    rows: list[tuple[Value, ...]] = []
    for family, verdicts in kept.items():
        wrong = [reason for _, _, reason in verdicts if reason]
        asked, found = sum(v[0] for v in verdicts), sum(v[1] for v in verdicts)
        rows.append(
            (family, len(verdicts), f"{found}/{asked}" if asked else "-", len(wrong), wrong[0] if wrong else "")
        )
    return Table(
        "Extremes: the whole path",
        ("streams", "how many", "swipes named rightly", "faults", "the first"),
        rows,
        (
            "A made finger swipes over made noise. Faults: a warning, an exception, scores that are no",
            "probabilities, an onset without its answer and release; and, where all swipes are asked for, any",
            "other answer.",
        ),
    )


def parts_table(models: list[Model], quick: bool) -> Table:
    """Windows, features and models on segments: cases, and what went wrong."""
    kept: dict[str, list[str]] = {}
    for family, segment in segment_cases(quick):
        kept.setdefault(family, []).append(_parts(segment, models))
    for family, segment in broken_segments(quick):
        sure = [model.name for model in models if model.classify(segment).unknown != 1.0]
        kept.setdefault(family, []).append(f"{', '.join(sure)} gave an answer" if sure else "")
    rows: list[tuple[Value, ...]] = [
        (family, len(found), sum(map(bool, found)), next(filter(None, found), "")) for family, found in kept.items()
    ]
    return Table(
        "Extremes: windows, features and models",
        ("segments", "how many", "faults", "the first"),
        rows,
        (
            f"Each segment through {len(WINDOWS)} windows, their features and the {len(models)} shipped models.",
            "Faults: a warning, a window outside 0 to 1, anything not finite, scores that are no probabilities;",
            "and any answer but unknown to what is not finite.",
        ),
    )


def _parts(segment: Segment, models: list[Model]) -> str:
    checks: list[Callable[[], bool]] = [
        *(lambda window=window: _window(window, segment) for window in WINDOWS),
        *(lambda model=model: _scores(model, segment) for model in models),
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for check in checks:
            try:
                if not check():
                    return "out of range"
            except (Warning, ArithmeticError, ValueError) as error:
                return f"{type(error).__name__}: {error}"
    return ""


def _window(window: Window, segment: Segment) -> bool:
    made = window.apply(segment)
    values = touch_pattern(made, window.rate_hz)
    return bool(len(made) and np.isfinite(values).all() and made.min() >= 0.0 and made.max() <= 1.0 + 1e-6)


def _scores(model: Model, segment: Segment) -> bool:
    answer = model.classify(segment)
    return bool(abs(float(answer.values.sum()) - 1.0) < 1e-3 and 0.0 <= answer.unknown <= 1.0)


def month_table(classifier: Classifier, days: float) -> Table:
    """Idle for so many days, a frame every 0.9 s (a whole second is silence), in slow waves; then a swipe."""
    step, swing = 0.9, 50.0
    times = np.arange(int(days * 86_400 / step)) * step + 2.0
    rng = np.random.default_rng(30)
    front = FrontEnd("stability", 9, 9)
    recognizer = Recognizer(front, classifier)
    for k in range(30):
        recognizer.push(Frame(k / 15, IDLE_LEVEL + NOISE * rng.standard_normal((9, 9))))
    heard: Counter[type] = Counter()
    for part in np.array_split(times, max(len(times) // 10_000, 1)):
        noise = NOISE * rng.standard_normal((len(part), 9, 9))
        noise += IDLE_LEVEL + swing * np.sin(2 * np.pi * part / 86_400.0)[:, None, None]
        for t, frame in zip(part, noise, strict=True):
            heard.update(map(type, events_of(recognizer.push(Frame(float(t), frame)))))
    end = float(times[-1])
    level = IDLE_LEVEL + swing * float(np.sin(2 * np.pi * end / 86_400.0))
    off = level - front.baseline
    after, _ = swipes(1, level=level)
    found: list[Event] = []
    for t, frame in zip(after.times + end + 0.1, after.frames, strict=True):
        found += events_of(recognizer.push(Frame(float(t), frame)))
    found += events_of(recognizer.flush(end + 10.0))
    return Table(
        "Running means after a long time idle",
        ("days", "frames", "contacts", "gestures", "baseline off by (noise)", "noise found / true", "then a swipe is"),
        [
            (
                days,
                len(times),
                heard[Onset],
                heard[Gesture],
                float(np.abs(off).max() / NOISE),
                front.noise / NOISE,
                " ".join(labels(found)),
            )
        ],
        (
            "One frame every 0.9 s; the baseline swings by 50 counts a day. The worst taxel's baseline is off",
            "by its own noise: it follows with 2 s, so that of frames so far apart it averages few.",
        ),
    )
