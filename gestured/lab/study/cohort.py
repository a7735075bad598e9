"""The simulated cohort of 3060 for the study: each gesture's segment, its window, and who performed it and how.

Every trial goes through the front end that the daemon runs. A trial whose gesture was not cut out is lost and counted;
if several segments hold parts of it, the one that holds most of it stands for it. Beside the cohort there are other
recordings: the public development recordings, and those that only judge.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import GesturedError
from gestured.core.frames import Segment
from gestured.core.window import Window
from gestured.lab.dataset import TRIALS, cuts, in_processes, matched, recorded, truths
from gestured.lab.digest import code_digest
from gestured.lab.samples import WINDOW, Samples, collect, sample
from gestured.lab.train import REAL_FILES
from gestured.lab.written import load, save
from gestured.record.arrays import read
from gestured.simulator import GESTURES, NONE, Trial, cohort_take

SEED = 0  # of the cohort that learns and is judged
TUNING_SEED = 1  # of other people, on whom hyperparameters are compared
NEW_SEED = 2  # of people whom nothing has learned from, neither the study's models nor those that ship


@dataclass(frozen=True)
class Cohort:
    """G gestures that were cut out of the trials."""

    frames: NDArray[np.float32]  # (N, R, C) counts above the baseline, one segment after the other
    times: NDArray[np.float64]  # (N,) s
    offsets: NDArray[np.int64]  # (G + 1,)
    first: NDArray[np.int64]  # (G,) first touched frame within the segment
    last: NDArray[np.int64]  # (G,) last one
    noise: NDArray[np.float64]  # (G,) counts
    trial: NDArray[np.int64]  # (G,) index into the cohort's plan
    performed: int  # trials, cut out or not

    def __len__(self) -> int:
        return len(self.trial)

    @property
    def lost(self) -> int:
        """Trials whose gesture was not cut out."""
        return self.performed - len(self)

    def segment(self, i: int) -> Segment:
        """One gesture as the front end cut it."""
        span = slice(self.offsets[i], self.offsets[i + 1])
        return Segment(self.frames[span], self.times[span], int(self.first[i]), int(self.last[i]), float(self.noise[i]))

    def trials(self) -> list[Trial]:
        """What was performed, for each gesture."""
        return [TRIALS[i] for i in self.trial]

    @cached_property
    def samples(self) -> Samples:
        """Windows as the daemon's models see them."""
        return self.windows(WINDOW)

    def windows(self, window: Window) -> Samples:
        """The gestures through another window."""
        plan = self.trials()
        return collect(
            sample(segment, trial.gesture, trial.gesture, trial.participant, window)
            for trial, segment in zip(plan, map(self.segment, range(len(self))), strict=True)
        )


def _cut(seed: int, index: int) -> Segment | None:
    """The segment that holds most of a trial's gesture."""
    take = cohort_take(TRIALS[index], seed)
    performed = truths(take)
    found = [segment for segment in cuts(take.frames, take.times) if any(matched([segment], performed))]
    return max(found, key=lambda s: min(s.offset, performed[0].offset) - max(s.onset, performed[0].onset), default=None)


def load_cohort(cache: Path, trials: NDArray[np.int64], jobs: int, seed: int = SEED) -> Cohort:
    """A cohort's gestures of these trials, from `cache` if they were made before."""
    key = hashlib.sha256(code_digest(__name__).encode() + trials.tobytes()).hexdigest()
    path = cache / f"study-cohort-{seed}-{len(trials)}-{key[:12]}.npz"
    fields = load(path)
    if fields is None:
        fields = _fields(trials, in_processes(partial(_cut, seed), trials.tolist(), jobs, "simulating the cohort"))
        save(path, fields)
    return Cohort(**fields, performed=len(trials))


def _fields(trials: NDArray[np.int64], segments: Iterable[Segment | None]) -> dict[str, NDArray[Any]]:
    cut = [(index, segment) for index, segment in zip(trials, segments, strict=True) if segment is not None]
    kept = [segment for _, segment in cut]
    return {
        "frames": np.concatenate([s.frames for s in kept]).astype(np.float32),
        "times": np.concatenate([s.times for s in kept]), "noise": np.array([s.noise for s in kept]),
        "offsets": np.cumsum([0, *(len(s.frames) for s in kept)], dtype=np.int64),
        "first": np.array([s.first for s in kept], np.int64), "last": np.array([s.last for s in kept], np.int64),
        "trial": np.array([index for index, _ in cut], np.int64),
    }  # fmt: skip


REAL_NAME = "CapFingerId, development subjects: a capacitive touchscreen, no textile"


def real(folder: Path | None, of_each: int | None) -> tuple[Samples, dict[str, Any]] | None:
    """Gestures of the real development recordings (at most `of_each` a subject) and what they are; None without them.

    Only the file of cut gestures is read: the whole sessions hold the same touches again.
    """
    if folder is None:
        return None
    found = read(folder / REAL_FILES[0])
    if of_each is not None:
        gestures = np.flatnonzero(found.labels != NONE)
        first = [gestures[found.subjects[gestures] == s][:of_each] for s in np.unique(found.subjects)]
        found = found.take(np.sort(np.concatenate(first)))
    samples = recorded(found)
    known = np.isin(samples.labels, GESTURES)
    about = {
        "name": REAL_NAME, "subjects": len(np.unique(samples.people)), "gestures": int(known.sum()),
        "non_gestures": int((~known).sum()),
    }  # fmt: skip
    return samples.take(known), about


def judges(path: Path) -> tuple[Samples, dict[str, Any]]:
    """Gestures of a file that judge every method and teach none, and their figures. Raises GesturedError for none."""
    found = read(path)
    performed = int(np.isin(found.labels, GESTURES).sum())
    samples = recorded(found.take(np.flatnonzero(np.isin(found.labels, GESTURES))))
    samples = samples.take(np.isin(samples.labels, GESTURES))
    if not len(samples):
        raise GesturedError(f"{path}: expected gestures that can be cut out, found none")
    people = len(np.unique(samples.people))
    return samples, {"name": path.name, "participants": people, "performed": performed, "cut": len(samples)}
