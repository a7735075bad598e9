"""Material of `adapt`: a user's own recordings, cut as the daemon cuts, and who performed them.

A name that the model does not know is left out: it is neither taught nor rejected, so that it can still be enrolled.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import GesturedError, RecordingError
from gestured.lab.dataset import recorded
from gestured.lab.recordings.protocol import one_spelling
from gestured.lab.recordings.store import touched
from gestured.lab.samples import Samples, collect, join
from gestured.record.arrays import read_timed
from gestured.record.check import SESSION
from gestured.record.judge import UNNAMED
from gestured.record.recordings import Recordings
from gestured.simulator import GESTURES, NONE

MOST_PEOPLE = 1000  # more are probably another field, such as the number of the trial
FEWEST = 20  # gestures; fewer cannot tell a better model from a worse one
LEAST_CUT = 2  # gestures that are cut out: one to learn from while the other is held out
GROUPS = 5  # of people, each of which is held out in turn


@dataclass(frozen=True)
class Own:
    """Samples of own recordings, and the gestures that were performed and never cut out."""

    samples: Samples  # `people` are places in `names`
    sittings: NDArray[np.int64]  # (G,) the session, or file of cut gestures, of each sample
    names: tuple[str, ...]  # pseudonyms
    missed: NDArray[np.int64]  # (M, 2) person and sitting of each missed gesture
    left_out: dict[str, int]  # how often each name that the model does not know was performed
    grid: tuple[int, ...] = ()  # rows and columns of the frames

    @property
    def performed(self) -> int:
        """How many gestures of the model were performed."""
        return int((self.samples.labels != NONE).sum()) + len(self.missed)


def own_recordings(paths: Sequence[Path], as_none: Collection[str] = ()) -> Own:
    """Read and cut recordings. Raises RecordingError or GesturedError if nothing can be learned from them."""
    names: dict[str, int] = {}
    parts: list[Samples] = []
    missed: list[tuple[int, int]] = []
    left: Counter[str] = Counter()
    grid: tuple[int, ...] | None = None
    seen: dict[bytes, Path] = {}
    for path in paths:
        found = _read(path, seen)
        if grid is not None and found.frames.shape[1:] != grid:
            here, before = ("x".join(map(str, shape)) for shape in (found.frames.shape[1:], grid))
            raise RecordingError(
                f"{path}: frames: expected the grid {before} of the files before it, found {here}; adapt to one sensor"
            )
        grid = found.frames.shape[1:]
        people = np.array([names.setdefault(str(subject), len(names)) for subject in found.subjects], np.int64)
        if len(names) > MOST_PEOPLE:
            raise RecordingError(
                f"{path}: subjects: expected at most {MOST_PEOPLE} people, found more; is it the number of the trial?"
            )
        for one, other in pairwise(sorted(names, key=one_spelling)):
            if one_spelling(one) == one_spelling(other):
                raise RecordingError(
                    f"{path}: subjects: expected one name for each person, found {one!r} and {other!r}; if they are "
                    "one person, nobody new would be judged; if not, give them names that differ more"
                )
        found = _named(replace(found, subjects=people), path, as_none, left)
        for part in _sittings(found):
            samples = _cut(part, path)
            missed += [(person, len(parts)) for person in _missed(part, samples)]
            parts.append(samples)
    own = Own(
        join([collect([]), *parts]),
        np.repeat(np.arange(len(parts)), np.array([len(part) for part in parts], np.int64)),
        tuple(names),
        np.array(missed, np.int64).reshape(-1, 2),
        dict(left),
        grid or (),
    )
    if own.performed < FEWEST:
        others = "; names of your own are enrolled, not learned: " + ", ".join(sorted(left)) if left else ""
        raise GesturedError(
            f"{', '.join(map(str, paths))}: expected at least {FEWEST} gestures of the model, "
            f"found {own.performed}{others}"
        )
    if (cut := int((own.samples.labels != NONE).sum())) < LEAST_CUT:
        raise GesturedError(
            f"{', '.join(map(str, paths))}: expected gestures that the front end cuts out, "
            f"found {cut} of {own.performed}; are these a sensor's raw counts?"
        )
    return own


@dataclass(frozen=True)
class Groups:
    """The groups that are held out in turn."""

    unit: str  # what a group is made of
    of_samples: NDArray[np.int64]  # (G,) 0 .. count - 1
    unit_of_samples: NDArray[np.int64]  # (G,) the units over which intervals are drawn
    unit_of_missed: NDArray[np.int64]  # (M,)

    @property
    def count(self) -> int:
        """How many groups there are."""
        return int(self.of_samples.max()) + 1


def held_out(own: Own) -> Groups:
    """At most `GROUPS` groups: of people; for one person, of sessions or files; for one sitting, of stretches of it."""
    owners = ((own.samples.people, own.missed[:, 0], "people"), (own.sittings, own.missed[:, 1], "sessions"))
    for units, lost, name in owners:
        different, counts = np.unique(units, return_counts=True)
        if len(different) >= 2:
            group_of = dealt(different, counts)
            of_samples = np.array([group_of[unit] for unit in units.tolist()], np.int64)
            return Groups(name, of_samples, units, lost)
    count = min(GROUPS, len(own.samples))
    stretch = np.arange(len(own.samples)) * count // len(own.samples)
    return Groups("parts of one session", stretch, stretch, np.arange(len(own.missed)) % count)


def dealt(units: NDArray[np.int64], counts: NDArray[np.int64]) -> dict[int, int]:
    """The group of each unit; the largest units come first, each goes into the group that is smallest by then."""
    size = [0] * min(GROUPS, len(units))
    found = {}
    for k in np.argsort(-counts, kind="stable"):
        group = size.index(min(size))
        found[int(units[k])] = group
        size[group] += int(counts[k])
    return found


def _read(path: Path, seen: dict[bytes, Path]) -> Recordings:
    """Read a file; `seen` has the file of each recording that was read: a copy would be learned from while held out."""
    found = read_timed(path)
    lengths = np.diff(found.offsets)
    if not len(found):
        raise RecordingError(f"{path}: labels: expected recordings, found none")
    if (lengths < 2).any():
        raise RecordingError(f"{path}: frames of recording {int(np.argmin(lengths))}: expected more than one")
    for i in range(len(found)):
        times, frames = found.times_of(i), np.asarray(found.frames_of(i), np.float32)
        key = sha256(np.round(times - times[0], 6).tobytes() + frames.tobytes()).digest()
        if key in seen:
            raise RecordingError(f"{path}: frames of recording {i}: expected no copy of one in {seen[key]}")
        seen[key] = path
    return found


def _named(found: Recordings, path: Path, as_none: Collection[str], left: Counter[str]) -> Recordings:
    """Labels as the model has them: its gestures, `none` with its kind, or `other` for what is left out."""
    labels, kinds = _as_known(found.labels, found.kinds, as_none, left)
    found = replace(found, labels=labels, kinds=kinds)
    if found.event_labels is not None:
        labels_of, kinds_of = _as_known(found.event_labels, found.event_kinds, as_none, left)
        found = replace(found, event_labels=labels_of, event_kinds=kinds_of)
    elif (labels == SESSION).any():
        raise RecordingError(f"{path}: event_labels: missing; nobody knows what was performed in its sessions")
    return found.take(np.flatnonzero(labels != UNNAMED))


def _as_known(
    labels: NDArray[np.str_], kinds: NDArray[np.str_] | None, as_none: Collection[str], left: Counter[str]
) -> tuple[NDArray[np.str_], NDArray[np.str_]]:
    names, fine = [], []
    for label, kind in zip(labels.tolist(), (labels if kinds is None else kinds).tolist(), strict=True):
        if label in as_none:
            label, kind = NONE, label
        elif label not in (*GESTURES, NONE, SESSION):
            left.update([] if label == UNNAMED else [label])
            label = UNNAMED
        names.append(label)
        fine.append(NONE if label == NONE and kind in GESTURES else kind)  # a kind that is a gesture would be its class
    return np.array(names, dtype="U64"), np.array(fine, dtype="U1024")


def _sittings(found: Recordings) -> list[Recordings]:
    """Each session by itself, and the cut gestures of a file together."""
    session = found.labels == SESSION
    cut = np.flatnonzero(~session)
    return [found.take([i]) for i in np.flatnonzero(session).tolist()] + ([found.take(cut)] if len(cut) else [])


def _cut(part: Recordings, path: Path) -> Samples:
    """Windows of one sitting; gestures without marks are marked by the front end."""
    if part.labels[0] != SESSION and (part.onsets is None or part.releases is None):
        marks = [touched(part.frames_of(i), part.times_of(i)) for i in range(len(part))]
        seen = np.array([mark is not None for mark in marks])
        part = part.take(np.flatnonzero(seen))
        both = np.array([mark for mark in marks if mark is not None], np.int64).reshape(-1, 2)
        part = replace(part, onsets=both[:, 0], releases=both[:, 1])
    try:
        return recorded(part)
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from error


def _missed(part: Recordings, samples: Samples) -> list[int]:
    """The person of each gesture of a sitting that was performed and not cut out."""
    if part.event_labels is not None and part.labels[0] == SESSION:
        performed = np.repeat(part.subjects[0], int(np.isin(part.event_labels, GESTURES).sum()))
    else:
        performed = part.subjects[np.isin(part.labels, GESTURES)]
    wanted, cut = Counter(performed.tolist()), Counter(samples.people[samples.labels != NONE].tolist())
    return [person for person, count in wanted.items() for _ in range(max(count - cut[person], 0))]
