"""Training windows: recordings and simulated takes, cut by the front end that the daemon runs.

A take is pushed frame by frame through `FrontEnd`, and its segments are matched with what was performed. Simulated sets
are cached, keyed by everything that makes them.
"""

import multiprocessing
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from multiprocessing import resource_tracker
from multiprocessing.pool import IMapIterator
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gestured.client.stop import stop_later
from gestured.core.errors import GesturedError, RecordingError
from gestured.core.frames import Frame, Segment
from gestured.core.front_end import Cut, FrontEnd
from gestured.lab.digest import code_digest
from gestured.lab.progress import progress
from gestured.lab.samples import EVERYDAY, LIKE_A_TAP, PART, WINDOW, Sample, Samples, collect, sample
from gestured.lab.written import load, save
from gestured.record.judge import UNNAMED, whose
from gestured.record.recordings import Recordings
from gestured.simulator import (
    NON_GESTURES,
    NONE,
    SPEEDS,
    Participant,
    SimulatedSensor,
    Take,
    cohort_plan,
    cohort_take,
    generator,
    gesture_take,
    wide,
)  # fmt: skip
from gestured.simulator.chance import CHANCE
from gestured.simulator.everyday import Day, day, planned
from gestured.simulator.places import PLACES, Place
from gestured.simulator.variety import any_sensor

N = TypeVar("N")
T = TypeVar("T")

IDLE = 20  # frames that are put on each side of a cut recording
DAY_S = 720.0  # of one person's everyday life
ANY_SENSOR = 0.5  # share of the days on any sensor; the others are on the nominal one
FASTEST_HZ = 40.0  # of a day's sensor: faster ones cost more and show the same
WATCH_S = 1.0  # s between two checks whether processes are alive, while no result comes
OVERLAP = 0.5  # share of a performed gesture that must lie in a segment for the segment to carry its label


@dataclass(frozen=True, slots=True)
class Truth:
    """What was performed from `onset` to `offset` seconds."""

    label: str
    kind: str
    person: int
    onset: float
    offset: float


def cuts(frames: NDArray[np.generic], times: NDArray[np.float64]) -> list[Segment]:
    """(N, R, C) raw frames of one recording and their times (N,) -> the segments that the front end cuts out."""
    front = FrontEnd(*frames.shape[1:])
    found = [x for values, t in zip(frames, times, strict=True) for x in front.push(Frame(float(t), values))]
    found += front.flush(float(times[-1]) + front.timing.stale_s)
    return [x.segment for x in found if isinstance(x, Cut)]


def matched(segments: Iterable[Segment], performed: Sequence[Truth]) -> Iterator[Sample]:
    """Samples of the segments that hold a performed gesture, or nothing but a non-gesture.

    Segments are widened by a frame at both ends, since contact is known only to the frame.
    """
    frame = 1 / WINDOW.rate_hz
    for segment in segments:
        best, share = None, 0.0
        for event in performed:
            common = min(segment.offset + frame, event.offset) - max(segment.onset - frame, event.onset)
            covered = common / max(event.offset - event.onset, 1e-3)
            if covered > share:
                best, share = event, covered
        if best is None or (best.label != NONE and share < OVERLAP):
            continue
        yield sample(segment, best.label, best.kind, best.person)


def truths(take: Take) -> list[Truth]:
    """What was performed in a simulated take."""
    return [Truth(act.label, act.kind, act.participant, act.onset_s, act.offset_s) for act in take.events]


def from_take(take: Take) -> list[Sample]:
    """The samples of one simulated take."""
    return list(matched(cuts(take.frames, take.times), truths(take)))


TRIALS = tuple(cohort_plan())  # 34 participants x 10 gestures x 3 speeds x 3 inclinations = 3060
OTHER_TRIALS = tuple(product(range(34), NON_GESTURES, SPEEDS))  # non-gestures of the same people


def from_day(life: Day) -> list[Sample]:
    """The samples of a day of everyday life, one for each segment that was cut out.

    A segment that nobody meant is of the kind EVERYDAY, but LIKE_A_TAP if it is a tap all the same, and PART if it
    holds less than half of a gesture. Nothing learns from the last two.
    """
    meant = [Truth(act.label, lay, act.participant, act.onset_s, act.offset_s) for act, lay in life.meant]
    like = [Truth(act.label, act.kind, act.participant, act.onset_s, act.offset_s) for act in life.like]
    found = []
    for segment in cuts(life.take.frames, life.take.times):
        of = next(matched([segment], meant), None)
        if of is None:
            alone = whose(segment.onset, segment.offset, like) is not None
            part = whose(segment.onset, segment.offset, meant) is not None
            of = sample(segment, NONE, LIKE_A_TAP if alone else PART if part else EVERYDAY, life.person)
        found.append(of)
    return found


def _day(places: Mapping[str, Place], seed: int, index: int) -> list[Sample]:
    """Some minutes of somebody's everyday life, on the nominal sensor or on any other."""
    rng = generator(seed, 0xDA7B, index)
    if rng.random() >= ANY_SENSOR:
        return _nominal_day(seed, index, places)
    sensor = any_sensor(rng, float(rng.random()))
    return _nominal_day(seed, index, places, replace(sensor, rate_hz=min(sensor.rate_hz, FASTEST_HZ)))


def meant_on(seed: int, index: int) -> int:
    """How many gestures are meant on that day of the stream "nominal_days", cut out or not."""
    return len(planned(seed * 1_000_000 + index, _place(PLACES, index), DAY_S).meant)


def _place(places: Mapping[str, Place], index: int) -> Place:
    return list(places.values())[index % len(places)]


def _nominal_day(
    seed: int, index: int, places: Mapping[str, Place] = PLACES, sensor: SimulatedSensor | None = None
) -> list[Sample]:
    return from_day(day(seed * 1_000_000 + index, _place(places, index), DAY_S, sensor))


def _wide(seed: int, index: int) -> list[Sample]:
    return from_take(wide(seed, index))


def _others(seed: int, index: int) -> list[Sample]:
    number, kind, speed = OTHER_TRIALS[index]
    person = seed * 1000 + number
    rng = generator(seed, 0x07, index)
    sensor, inclination = SimulatedSensor.nominal(day=person), int(rng.integers(3))
    return from_take(gesture_take(kind, Participant(person), sensor, rng, speed, inclination))


def _cohort(seed: int, index: int) -> list[Sample]:
    return from_take(cohort_take(TRIALS[index], seed))


STREAMS: dict[str, Callable[[int, int], list[Sample]]] = {
    "days": partial(_day, PLACES),
    "days_by_chance": partial(_day, CHANCE),
    "nominal_days": _nominal_day,
    "wide": _wide,
    "cohort": _cohort,
    "others": _others,
}


def in_processes(make: Callable[[N], T], todo: Sequence[N], jobs: int, title: str) -> Iterator[T]:
    """What `make` gives for each of `todo`, in order, by at most `jobs` processes; an interruption ends all of them.

    Raises GesturedError if one of them is killed: its work is lost, and the pool would wait for it for ever.
    """
    jobs = min(jobs, len(todo) or 1)
    others = multiprocessing.active_children()
    with ExitStack() as stack:
        with stop_later():  # a process that loses its parent while it starts ends in a traceback
            resource_tracker.ensure_running()  # first, since to start it unblocks Ctrl-C
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # inherited, so that none prints a traceback
            pool = stack.enter_context(multiprocessing.get_context("spawn").Pool(jobs))
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])  # one that came meanwhile has waited
        workers = [process for process in multiprocessing.active_children() if process not in others]
        made = pool.imap(make, todo)  # with chunks it gives a generator, which has no timeout
        yield from progress(_while_alive(made, workers), len(todo), title)


def _while_alive(made: "IMapIterator[T]", workers: Sequence[BaseProcess]) -> Iterator[T]:
    while True:
        try:
            yield made.next(timeout=WATCH_S)
        except multiprocessing.TimeoutError:
            if not all(worker.is_alive() for worker in workers):
                raise GesturedError(
                    "a process that --jobs started was killed, as where there is too little memory"
                ) from None
        except StopIteration:
            return


def simulated(cache: Path, stream: str, seed: int, count: int, jobs: int = 2) -> Samples:
    """The first `count` takes of one of `STREAMS`, from `cache` if they were made before."""
    path = cache / f"{stream}-{seed}-{count}-{code_digest(__name__)[:12]}.npz"
    if stored := load(path):
        return Samples(**stored)
    made = in_processes(partial(STREAMS[stream], seed), range(count), jobs, f"simulating {stream}")
    samples = collect(s for found in made for s in found)
    save(path, {name: getattr(samples, name) for name in Samples.__slots__})
    return samples


def recorded(recordings: Recordings) -> Samples:
    """Samples of cut gestures or whole sessions, without touches that the truth does not name, and single frames.

    People who have names become numbers, in the order of their names.
    """
    people = recordings.subjects
    if people.dtype.kind == "U":
        people = np.unique(people, return_inverse=True)[1]
    return collect(s for i, person in enumerate(people.tolist()) for s in _recorded(recordings, i, int(person)))


def _recorded(recordings: Recordings, i: int, person: int) -> Iterator[Sample]:
    frames, times = recordings.frames_of(i), recordings.times_of(i)
    if len(times) < 2:
        return
    # Marks are frames, and a frame stands for the time around it, so a tap of one frame has a duration, too.
    half = float(np.median(np.diff(times))) / 2
    if recordings.labels[i] == "session":
        of, labels, kinds, onsets, offsets = (
            _needed(recordings, f"event_{name}") for name in ("recording", "labels", "kinds", "onsets", "offsets")
        )
        performed = [
            Truth(str(labels[k]), str(kinds[k]), person, float(onsets[k]) - half, float(offsets[k]) + half)
            for k in np.flatnonzero(of == i)
        ]
        known = [p for p in performed if p.label != UNNAMED]
        for segment in cuts(frames, times):
            if all(segment.offset < p.onset or segment.onset > p.offset for p in performed if p.label == UNNAMED):
                yield from matched([segment], known)
        return
    first, last = int(_needed(recordings, "onsets")[i]), int(_needed(recordings, "releases")[i])
    frames, times, lead = with_idle(frames, times, first, last, i)
    label = str(recordings.labels[i])
    kind = label if recordings.kinds is None else str(recordings.kinds[i])
    onset, offset = times[first + lead] - half, times[last + lead] + half
    yield from matched(cuts(frames, times), [Truth(label, kind, person, onset, offset)])


def _needed(recordings: Recordings, field: str) -> NDArray[Any]:
    found: NDArray[Any] | None = getattr(recordings, field)
    if found is None:
        raise RecordingError(f"{field}: missing; without it nobody knows what was performed when")
    return found


def with_idle(
    frames: NDArray[np.generic], times: NDArray[np.float64], first: int, last: int, seed: int
) -> tuple[NDArray[np.generic], NDArray[np.float64], int]:
    """Put `IDLE` idle frames before and after a cut recording, drawn from its own quiet frames.

    The front end needs a second to learn the idle sensor, and many recordings end where the next touch began.
    Returns frames, times, and how many were put before.
    """
    quiet = np.concatenate([frames[: max(first - 1, 0)], frames[last + 3 :]])
    if not len(quiet):
        quiet = np.minimum(frames.min(axis=0), np.median(frames.min(axis=0))).astype(frames.dtype)[None]
    rng = np.random.default_rng([seed, 7])
    step = float(np.median(np.diff(times)))
    around = quiet[rng.integers(0, len(quiet), 2 * IDLE)]
    before, after = times[0] - step * np.arange(IDLE, 0, -1), times[-1] + step * np.arange(1, IDLE + 1)
    return np.concatenate([around[:IDLE], frames, around[IDLE:]]), np.concatenate([before, times, after]), IDLE
