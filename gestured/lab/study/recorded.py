"""Recordings that the cohort does not hold: the public development recordings, and those that judge alone."""

from pathlib import Path
from typing import Any

import numpy as np

from gestured.core.errors import GesturedError
from gestured.lab.dataset import recorded
from gestured.lab.samples import Samples
from gestured.lab.train import REAL_FILES
from gestured.record.arrays import read
from gestured.simulator import GESTURES, NONE

REAL_NAME = "CapFingerId, development subjects: a capacitive touchscreen, no textile"


def real(folder: Path | None, of_each: int | None) -> tuple[Samples, dict[str, Any]] | None:
    """Gestures of the real development recordings (at most `of_each` a subject) and what they are; None without them.

    Only the file of cut gestures: the whole sessions hold the same touches again.
    """
    if folder is None or not (folder / REAL_FILES[0]).exists():
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
    """Gestures of a file that judge every method and teach none, and how many were performed and cut out."""
    found = read(path)
    performed = int(np.isin(found.labels, GESTURES).sum())
    samples = recorded(found.take(np.flatnonzero(np.isin(found.labels, GESTURES))))
    samples = samples.take(np.isin(samples.labels, GESTURES))
    if not len(samples):
        raise GesturedError(f"{path}: expected gestures that can be cut out, found none")
    people = len(np.unique(samples.people))
    return samples, {"name": path.name, "participants": people, "performed": performed, "cut": len(samples)}
