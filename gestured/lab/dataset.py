"""Windows to learn from: recordings and simulated takes, cut by the very front end that the daemon runs.

Nothing here re-does the core's work: a take is pushed frame by frame through `FrontEnd`, and what it cuts is
matched with what was performed. Simulated sets are cached, keyed by everything that makes them.
"""

import hashlib
import multiprocessing
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import RecordingError
from gestured.core.features import touch_pattern
from gestured.core.found import Cut
from gestured.core.frames import Frame, Segment
from gestured.core.front_end import FrontEnd
from gestured.core.window import Window
from gestured.lab.digest import code_digest
from gestured.lab.progress import progress
from gestured.record.files import PUBLIC, atomic_write
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

if TYPE_CHECKING:
    from gestured.record.recordings import Recordings

WINDOW = Window(rows=9, columns=9, rate_hz=15.0, smooth_frames=1, lead_s=1 / 15, tail_s=1 / 15, floor=4.0)
OVERLAP = 0.5  # of a performed gesture must lie in a segment for it to carry its label


@dataclass(frozen=True, slots=True)
class Samples:
    """G windows of varying length with what is known of them."""

    frames: NDArray[np.float16]  # (N, R, C), one after the other
    offsets: NDArray[np.int64]  # (G + 1,)
    labels: NDArray[np.str_]  # (G,) gesture or "none"
    kinds: NDArray[np.str_]  # (G,) the finer name
    people: NDArray[np.int64]  # (G,) participant or subject
    strength: NDArray[np.float64]  # (G,) peak in units of the sensor's noise
    first: NDArray[np.int64]  # (G,) index of the first touched frame in its window
    last: NDArray[np.int64]  # (G,) and of the last one

    def __len__(self) -> int:
        return len(self.labels)

    def window(self, index: int) -> NDArray[np.float32]:
        """(T, R, C) window of one sample."""
        return self.frames[self.offsets[index] : self.offsets[index + 1]].astype(np.float32)

    def lengths(self) -> NDArray[np.int64]:
        """(G,) frames of each."""
        return np.diff(self.offsets)

    def features(self) -> NDArray[np.float32]:
        """(G, F) touch-pattern features."""
        return np.stack([touch_pattern(self.window(i), WINDOW.rate_hz) for i in range(len(self))])

    def take(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> "Samples":
        """The chosen samples, in that order."""
        index = np.flatnonzero(chosen) if chosen.dtype == bool else chosen
        parts = [self.frames[self.offsets[i] : self.offsets[i + 1]] for i in index]
        return Samples(
            np.concatenate(parts) if parts else self.frames[:0],
            np.concatenate([[0], np.cumsum([len(p) for p in parts], dtype=np.int64)]).astype(np.int64),
            self.labels[index], self.kinds[index], self.people[index], self.strength[index],
            self.first[index], self.last[index],
        )  # fmt: skip

    def digest(self) -> str:
        """SHA-256 over everything."""
        total = hashlib.sha256()
        for array in (
            self.frames,
            self.offsets,
            self.labels.astype("U40"),
            self.kinds.astype("U40"),
            self.people,
        ):
            total.update(np.ascontiguousarray(array).tobytes())
        return total.hexdigest()


@dataclass(frozen=True, slots=True)
class Truth:
    """What was performed from `onset` to `offset` seconds."""

    label: str
    kind: str
    person: int
    onset: float
    offset: float


class Sample(NamedTuple):
    """One window, with what `Samples` holds of each."""

    window: NDArray[np.float16]
    label: str
    kind: str
    person: int
    strength: float
    first: int
    last: int


def sample(segment: Segment, label: str, kind: str, person: int, window: Window = WINDOW) -> Sample:
    """What was cut, through a window."""
    frames = window.apply(segment).astype(np.float16)
    strength = float(segment.frames[segment.first : segment.last + 1].max()) / max(segment.noise, 1e-30)
    begin = segment.times[window.span(segment)[0]]
    first, last = (min(round((t - begin) * window.rate_hz), len(frames) - 1) for t in (segment.onset, segment.offset))
    return Sample(frames, label, kind, person, strength, first, last)


def collect(samples: Iterable[Sample]) -> Samples:
    """Put single samples together."""
    found = list(samples)
    frames = [s[0] for s in found]
    return Samples(
        np.concatenate(frames) if frames else np.zeros((0, WINDOW.rows, WINDOW.columns), np.float16),
        np.concatenate([[0], np.cumsum([len(f) for f in frames])]).astype(np.int64),
        np.array([s[1] for s in found], dtype="U40"),
        np.array([s[2] for s in found], dtype="U40"),
        np.array([s[3] for s in found], dtype=np.int64),
        np.array([s[4] for s in found], dtype=np.float64),
        np.array([s[5] for s in found], dtype=np.int64),
        np.array([s[6] for s in found], dtype=np.int64),
    )


def join(parts: Sequence[Samples]) -> Samples:
    """Several sets as one."""
    starts = np.cumsum([0] + [int(p.offsets[-1]) for p in parts])
    offsets = [p.offsets[:-1] + start for p, start in zip(parts, starts, strict=False)]
    return Samples(
        np.concatenate([p.frames for p in parts]),
        np.concatenate([*offsets, starts[-1:]]).astype(np.int64),
        np.concatenate([p.labels for p in parts]),
        np.concatenate([p.kinds for p in parts]),
        np.concatenate([p.people for p in parts]),
        np.concatenate([p.strength for p in parts]),
        np.concatenate([p.first for p in parts]),
        np.concatenate([p.last for p in parts]),
    )


def cuts(frames: NDArray[np.generic], times: NDArray[np.float64]) -> list[Segment]:
    """(N, R, C) raw frames of one recording and their times (N,) -> what the front end cuts out of them."""
    front = FrontEnd("lab", *frames.shape[1:])
    found = [x for values, t in zip(frames, times, strict=True) for x in front.push(Frame(float(t), values))]
    found += front.flush(float(times[-1]) + front.timing.stale_s)
    return [x.segment for x in found if isinstance(x, Cut)]


def matched(segments: Iterable[Segment], performed: Sequence[Truth]) -> Iterator[Sample]:
    """Windows of the segments that hold a performed gesture, or nothing but a non-gesture.

    A frame stands for the time up to its neighbours: contact is known to one frame only.
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
    """One simulated take."""
    return list(matched(cuts(take.frames, take.times), truths(take)))


TRIALS = tuple(cohort_plan())  # 34 participants x 10 gestures x 3 speeds x 3 inclinations = 3060
OTHER_TRIALS = tuple(
    (p, k, s) for p in range(34) for k in NON_GESTURES for s in SPEEDS
)  # the same people do something else


def _wide(seed: int, index: int) -> list[Sample]:
    return from_take(wide(seed, index))


def _others(seed: int, index: int) -> list[Sample]:
    number, kind, speed = OTHER_TRIALS[index]
    person = seed * 1000 + number
    rng = generator(seed, 0x07, index)
    take = gesture_take(
        kind, Participant(person), SimulatedSensor.nominal(day=person), rng, speed, int(rng.integers(3))
    )
    return from_take(take)


def _cohort(seed: int, index: int) -> list[Sample]:
    return from_take(cohort_take(TRIALS[index], seed))


STREAMS = {"wide": _wide, "cohort": _cohort, "others": _others}


def simulated(cache: Path, stream: str, seed: int, count: int, jobs: int = 2) -> Samples:
    """The first `count` takes of one of `STREAMS`, from `cache` where they were made before."""
    path = cache / f"{stream}-{seed}-{count}-{code_digest(__name__)[:12]}.npz"
    if path.exists():
        with np.load(path, allow_pickle=False) as stored:
            return Samples(*(stored[name] for name in Samples.__slots__))
    make: Callable[[int], list[Sample]] = partial(STREAMS[stream], seed)
    with multiprocessing.get_context("spawn").Pool(jobs, signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        made = pool.imap(make, range(count), chunksize=50)
        samples = collect(s for found in progress(made, count, f"simulating {stream}") for s in found)
    cache.mkdir(parents=True, exist_ok=True)
    with atomic_write(path, PUBLIC, durable=False) as file:
        np.savez(file, **{name: getattr(samples, name) for name in Samples.__slots__})
    return samples


def recorded(recordings: "Recordings", seed: int = 0) -> Samples:
    """Cut gestures or whole sessions as samples; what the truth does not name is left out."""
    return collect(s for i in range(len(recordings)) for s in _recorded(recordings, i, seed))


def _recorded(recordings: "Recordings", i: int, seed: int) -> Iterator[Sample]:
    frames, times = recordings.frames_of(i), recordings.times_of(i)
    person = int(recordings.subjects[i])
    # Marks are frames, and a frame stands for the time around it: a tap of one frame has a duration, too.
    half = float(np.median(np.diff(times))) / 2 if len(times) > 1 else 0.0
    if recordings.labels[i] == "session":
        of, labels, kinds, onsets, offsets = (
            _needed(recordings, f"event_{name}") for name in ("recording", "labels", "kinds", "onsets", "offsets")
        )
        performed = [
            Truth(str(labels[k]), str(kinds[k]), person, float(onsets[k]) - half, float(offsets[k]) + half)
            for k in np.flatnonzero(of == i)
        ]
        known = [p for p in performed if p.label != "other"]
        for segment in cuts(frames, times):
            if all(segment.offset < p.onset or segment.onset > p.offset for p in performed if p.label == "other"):
                yield from matched([segment], known)
        return
    first, last = int(_needed(recordings, "onsets")[i]), int(_needed(recordings, "releases")[i])
    frames, times, lead = with_idle(frames, times, first, last, seed + i)
    label, kind = str(recordings.labels[i]), str(_needed(recordings, "kinds")[i])
    onset, offset = times[first + lead] - half, times[last + lead] + half
    yield from matched(cuts(frames, times), [Truth(label, kind, person, onset, offset)])


def _needed(recordings: "Recordings", field: str) -> NDArray[Any]:
    found: NDArray[Any] | None = getattr(recordings, field)
    if found is None:
        raise RecordingError(f"{field}: missing; without it nobody knows what was performed when")
    return found


def with_idle(
    frames: NDArray[np.generic], times: NDArray[np.float64], first: int, last: int, seed: int, count: int = 20
) -> tuple[NDArray[np.generic], NDArray[np.float64], int]:
    """Put `count` idle frames before and after a cut recording, drawn from its own quiet frames.

    The front end needs a second to learn the idle sensor, and many recordings end where the next touch began.
    Returns frames, times, and how many were put before.
    """
    quiet = np.concatenate([frames[: max(first - 1, 0)], frames[last + 3 :]])
    if not len(quiet):
        quiet = np.minimum(frames.min(axis=0), np.median(frames.min(axis=0))).astype(frames.dtype)[None]
    rng = np.random.default_rng([seed, 7])
    step = float(np.median(np.diff(times)))
    around = quiet[rng.integers(0, len(quiet), 2 * count)]
    before, after = times[0] - step * np.arange(count, 0, -1), times[-1] + step * np.arange(1, count + 1)
    return np.concatenate([around[:count], frames, around[count:]]), np.concatenate([before, times, after]), count
