"""Input that no sensor should send, through the code that the daemon runs: whether all that comes out is finite.

The whole path in one process (frames, front end, window, model, events) is given streams of a finger that swipes to the
right. Every warning counts as a fault.
"""

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.classifier import Classifier
from gestured.core.events import Cancelled, Event, Gesture, Onset, Release, Unknown
from gestured.core.mounting import Mounting
from gestured.core.scene import Scene, Setup
from gestured.core.sensor import Sensor
from gestured.lab.table import Table, Value
from gestured.model.embedded import Embedded
from gestured.simulator import GESTURES, Participant, SimulatedSensor, generator, gesture_take

Array = NDArray[Any]
FLUSH_AFTER_S = 2.0
SIGNAL, NOISE, IDLE_LEVEL = 600.0, 2.0, 300.0  # counts of a firm finger, of noise, of an idle taxel
# The largest numbers of float32, one that its square overflows, ordinary ones, two denormals, and both zeros.
FINITE = (float(np.finfo(np.float32).max), 1e30, 1.0, 1e-40, 1e-45, 0.0, -0.0, -1e-40, -1.0, -1e30)


@dataclass(frozen=True, slots=True)
class Series:
    """What a sensor sends: (n,) times in seconds, (n, R, C) raw counts."""

    times: Array
    frames: Array


def simulated_series(count: int, kinds: Sequence[str] = GESTURES, seed: int = 41) -> Iterator[tuple[str, Series]]:
    """So many simulated gestures, or other kinds, one after the other, a new person and sensor after each round."""
    for k in range(count):
        kind, person = kinds[k % len(kinds)], 7000 + seed * 100 + k // len(kinds)
        take = gesture_take(kind, Participant(person), SimulatedSensor.nominal(day=person), generator(seed, k))
        yield kind, Series(take.sensor_times, take.frames.astype(np.float64))


def events(stream: Series, classifier: Classifier, mounting: Mounting | None = None) -> list[Event]:
    """The events that a recogniser, as `gestured.open` makes it, gives for a stream."""
    mounted = {"stability": Setup(mounting=mounting or Mounting())}
    scene = Scene(classifier.gestures, stream.frames.shape[1:], mounted)
    recogniser, found = Embedded(Sensor("stability", scene, classifier), classifier.gestures), []
    for t, values in zip(stream.times, stream.frames, strict=True):
        found += recogniser.push(float(t), values)
    return found + recogniser.flush(float(stream.times[-1]) + FLUSH_AFTER_S)


def labels(found: list[Event]) -> tuple[str, ...]:
    """The answers, in order: a gesture, `unknown`, or why a contact was cancelled."""
    return tuple(
        event.gesture if isinstance(event, Gesture) else "unknown" if isinstance(event, Unknown) else event.reason
        for event in found
        if isinstance(event, Gesture | Unknown | Cancelled)
    )


def fault(found: list[Event]) -> str:
    """What breaks the contract (one answer and one release for each onset, finite numbers); '' if nothing does."""
    order = [event for event in found if not isinstance(event, Release)]
    releases = [event.id for event in found if isinstance(event, Release)]
    onsets = [event.id for event in found if isinstance(event, Onset)]
    if releases != onsets or [type(event) is Onset for event in order] != [True, False] * len(onsets):
        return "an onset without one answer and one release"
    for event in found:
        if isinstance(event, Gesture | Unknown):
            values = [event.confidence, event.onset, event.offset, *event.scores.values()]
            if not all(map(math.isfinite, values)) or abs(sum(event.scores.values()) - 1.0) > 1e-3:
                return "scores that are no probabilities"
    return ""


def finger(row: float, column: float, rows: int, columns: int, width: float) -> Array:
    """(R, C) counts of a finger at a row and a column, as wide as `width` taxels."""
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


FOUND = "swipe_right"  # the gesture of all swipes of `swipes`
LEAST_GRID = 3  # on 2 x 2 taxels a swipe is two taps


@dataclass(frozen=True, slots=True)
class Case:
    """A stream, and the times (s) of swipes that must be found; with `alone` there must be no other answer."""

    family: str
    stream: Series
    swipes: tuple[float, ...] = ()
    alone: bool = False


def streams(quick: bool) -> Iterator[Case]:
    """Streams for the whole path."""
    base, at = swipes(2)
    few = 27 if quick else 1
    for power in (*range(-30, 31, 15 if quick else 5), -3, -2, -1, 1, 2, 3):
        for kind in (np.float32, np.float64):
            scaled = Series(base.times, (base.frames * 10.0**power).astype(kind))
            yield Case("scale 1e-30 to 1e30", scaled, at, alone=True)
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
            constant = Series(np.arange(60) / 15, np.full((60, *shape), value))
            yield Case("constant signals: nothing", constant, alone=True)
    yield Case("one frame: nothing", Series(base.times[:1], base.frames[:1]), alone=True)
    touched = (base.times % 3.7 >= 1.5) & (base.times % 3.7 <= 2.0)
    for taxel in range(0, 81, few):
        frames = base.frames.copy().reshape(-1, 81)
        frames[touched, taxel] += SIGNAL
        yield Case("one active taxel", Series(base.times, frames.reshape(base.frames.shape)))
    for value in (4095.0, 65535.0, FINITE[0]):
        full = np.where(touched[:, None, None], value, base.frames)
        yield Case("all saturated, all equal", Series(base.times, full))
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
    for frames in (base.frames * 1e-315, (base.frames * 1e-42).astype(np.float32)):  # below the least normal number
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


def _held(count: int) -> Series:
    times = np.arange(1500 + count + 1000) / 1000
    frames = IDLE_LEVEL + NOISE * np.random.default_rng(count).standard_normal((len(times), 9, 9))
    frames[1500 : 1500 + count] += finger(4, 4, 9, 9, 1.0)
    return Series(times, frames)


def swipes_found(case: Case, classifier: Classifier) -> tuple[int, str]:
    """(number of swipes found, any other fault)."""
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
        share = f"{found}/{asked}" if asked else "-"
        rows.append((family, len(verdicts), share, len(wrong), wrong[0] if wrong else ""))
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
