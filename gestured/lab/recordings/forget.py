"""`gestured-lab forget`: removes a participant from files of recordings, and says which models learned from them."""

import argparse
import sys
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from gestured.client.say import say, say_drawn, say_json
from gestured.core.errors import GesturedError, RecordingError
from gestured.lab.digest import file_digest
from gestured.lab.recordings.origin import said
from gestured.record.arrays import read, write
from gestured.record.recordings import Recordings

CANNOT = "; its weights cannot forget: adapt or train it again without them"
FIELDS = {f"{field.name}.npy" for field in fields(Recordings)}


@dataclass(frozen=True, slots=True)
class Holding:
    """What is a participant's in a file."""

    path: Path
    sha256: str
    own: int
    all: int

    def __str__(self) -> str:
        if self.own == self.all:
            return f"{self.path}: all {self.all} recordings: the file is deleted"
        return f"{self.path}: {self.own} of {self.all} recordings: the file is written again without them"


def run(args: argparse.Namespace) -> int:
    """Say what would go, ask, and let it go. Exit status 1 where a file could not be looked into."""
    parts, unread = find(args.participant, args.paths)
    models = told(args.participant, parts, args.models)
    for line in [*map(str, parts), *(f"not looked into: {reason}" for reason in unread)]:
        say(line, to=sys.stderr if args.json else sys.stdout)
    if not parts:
        say(f"no recording of {args.participant} was found", to=sys.stderr if args.json else sys.stdout)
    done = bool(parts) and not args.dry_run and (args.yes or _agreed(args.participant))
    if done:
        for part in parts:
            remove(args.participant, part.path)
    if args.json:
        files = [{"file": str(p.path), "sha256": p.sha256, "recordings": p.own, "of": p.all} for p in parts]
        say_json({"participant": args.participant, "removed": done, "files": files, "not_looked_into": unread,
                  "models": models})  # fmt: skip
    else:
        _close(args.participant, parts, done, models)
    return 1 if unread else 0


def find(participant: str, paths: Sequence[Path]) -> tuple[list[Holding], list[str]]:
    """Where a participant's recordings are in these files and folders, and what could not be looked into."""
    parts, unread = [], []
    for path in paths:
        if not path.exists():
            raise GesturedError(f"{path}: is not there; nothing was removed")
    files = [file for path in paths for file in (_inside(path) if path.is_dir() else [path])]
    for file in dict.fromkeys(file.resolve() for file in files):  # a link is not what holds the recordings
        try:
            subjects = read(file).subjects.astype(str)
            own = int((subjects == participant).sum())
            if own and own < len(subjects):
                _whole(file)
        except RecordingError as error:
            unread.append(str(error))
            continue
        if own:
            parts.append(Holding(file, file_digest(file), own, len(subjects)))
    return parts, unread


def _inside(folder: Path) -> list[Path]:
    """The folder's files of recordings, and what `write` leaves behind where the power goes."""
    return sorted([*folder.rglob("*.npz"), *folder.rglob(".*.npz.*")])


def _whole(file: Path) -> None:
    """RecordingError where a file holds what would not be written again."""
    with zipfile.ZipFile(file) as archive:
        unknown = sorted(set(archive.namelist()) - FIELDS)
    if unknown:
        raise RecordingError(f"{file}: {unknown[0]}: is no field of the contract, and would be lost; take it out first")


def remove(participant: str, path: Path) -> None:
    """Rewrite the file without the participant, at once or not at all; delete it where nothing else is left."""
    recordings = read(path)
    others = np.flatnonzero(recordings.subjects.astype(str) != participant)
    if len(others):
        write(path, recordings.take(others))
    else:
        path.unlink()


def told(participant: str, parts: Sequence[Holding], folder: Path) -> dict[str, str]:
    """What each model in `folder` says of the participant: model -> a sentence."""
    answers = {}
    digests = {part.sha256: part.path for part in parts}
    for model in sorted(folder.glob("*.onnx")):
        try:
            origins = said(model)
        except (ValueError, OSError) as error:
            answers[str(model)] = f"cannot be read: {error}"
            continue
        if origins is None:
            answers[str(model)] = "cannot say: it does not list the recordings that it learned from"
            continue
        same = [digests[origin.sha256] for origin in origins if origin.sha256 in digests]
        named = [origin.file for origin in origins if participant in origin.subjects]
        if same:
            answers[str(model)] = f"was trained with {participant}: it learned from {same[0]} as it is now{CANNOT}"
        elif named:
            answers[str(model)] = (
                f"was trained with a participant {participant}, in a file {named[0]} with other contents than any here"
                f"{CANNOT}"
            )
        else:
            answers[str(model)] = f"was not trained with {participant}"
    return answers


def _agreed(participant: str) -> bool:
    if not sys.stdin.isatty():
        raise GesturedError("nobody can be asked here; expected --yes or --dry-run; nothing was removed")
    say_drawn(f"Remove participant {participant} from these files? It cannot be undone. (yes/no) ", end="")
    return sys.stdin.readline().strip().lower() == "yes"


def _close(participant: str, parts: Sequence[Holding], done: bool, models: dict[str, Any]) -> None:
    if done:
        say(f"removed: {sum(part.own for part in parts)} recordings of {participant}")
    elif parts:
        say("nothing was removed")
    for model, answer in models.items():
        say(f"model {model}: {answer}")
    if not models:
        say("no models were found; name their folder with --models")
    if done:
        say("Not looked for: copies, backups, and what was computed from the recordings (caches, reports).")
