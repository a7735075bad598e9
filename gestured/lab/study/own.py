"""Recordings that are not simulated: the public development recordings, and a researcher's own files.

Own files go through the same front end and the same protocols as everything else. What cannot be used is left out,
counted and named; the rest is used.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gestured.core.errors import GesturedError, RecordingError
from gestured.lab.dataset import recorded
from gestured.lab.recordings.safe import read_what_is_good
from gestured.lab.samples import Samples, join
from gestured.lab.train import REAL_FILES
from gestured.record.arrays import read
from gestured.record.recordings import Recordings
from gestured.simulator import GESTURES, NONE

REAL_NAME = "CapFingerId, development subjects: a capacitive touchscreen, no textile"
FEWEST = 2  # participants without whom nothing can be held out


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


@dataclass(frozen=True)
class Own:
    """A researcher's recordings: what is used, and what is not."""

    samples: Samples | None
    files: list[dict[str, Any]] = field(default_factory=list)
    left_out: list[dict[str, Any]] = field(default_factory=list)


def own(paths: Sequence[Path]) -> Own:
    """Gestures of these files; one name is one participant across files. GesturedError where nothing can be used."""
    parts: list[Samples] = []
    files: list[dict[str, Any]] = []
    left: list[dict[str, Any]] = []
    names: dict[str, int] = {}
    for path in paths:
        try:
            found, bad = read_what_is_good(path)
            left += [{"file": str(path), "recording": b.recording, "field": b.field, "reason": b.reason} for b in bad]
            dropped = {b.recording for b in bad if b.recording is not None}
            places = [i for i in range(len(found) + len(dropped)) if i not in dropped]
            samples = _gestures(found, path, places, names, left)
        except RecordingError as error:
            left.append({"file": str(path), "recording": None, "field": "", "reason": str(error)})
            files.append({"file": str(path), "recordings": 0, "used": 0})
            continue
        parts.append(samples)
        files.append({"file": str(path), "recordings": len(found) + len(dropped), "used": len(samples)})
    together = join(parts) if parts else None
    if paths and (together is None or len(np.unique(together.people)) < FEWEST):
        reasons = "; ".join(["found too few", *(str(entry["reason"]) for entry in left[:3])])
        raise GesturedError(f"--recordings: expected gestures of at least {FEWEST} participants, {reasons}")
    return Own(together, files, left)


def _gestures(
    found: Recordings, path: Path, places: list[int], names: dict[str, int], left: list[dict[str, Any]]
) -> Samples:
    """What the front end cuts of a file's recordings of known gestures; `places` are their indices in the file."""
    people = [names.setdefault(str(subject), len(names)) for subject in found.subjects]
    kinds = found.labels if found.kinds is None else found.kinds
    found = replace(found, subjects=np.array(people, np.int64), kinds=kinds)
    chosen = []
    for i, label in enumerate(found.labels):
        if label in GESTURES or label == "session":
            chosen.append(i)
        elif label != NONE:
            reason = f"labels: expected one of the ten gestures, {NONE} or session, found {label}"
            left.append({"file": str(path), "recording": places[i], "field": "labels", "reason": reason})
    samples = recorded(found.take(chosen))
    return samples.take(np.isin(samples.labels, GESTURES))
