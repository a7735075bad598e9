"""`gestured-lab forget`: removes a participant from files of recordings, and says which models learned from them."""

import argparse
import os
import sys
import zipfile
from collections.abc import Sequence
from dataclasses import fields
from itertools import chain
from pathlib import Path

import numpy as np

from gestured.client.say import say, say_drawn, say_json
from gestured.core.errors import GesturedError, RecordingError
from gestured.lab.recordings.origin import said
from gestured.lab.recordings.protocol import one_spelling
from gestured.record.arrays import read, write
from gestured.record.recordings import Recordings

FIELDS = {f"{field.name}.npy" for field in fields(Recordings)}


def run(args: argparse.Namespace) -> int:
    """Say what would be removed, ask, and remove it. Exit status 1 if a file could not be looked into, or stays."""
    name = args.participant
    searched, unread = _files(args.paths)
    found: dict[Path, tuple[int, int]] = {}  # how many recordings are the participant's, and how many there are
    like: set[str] = set()  # who may be the participant under another spelling
    for file in searched:
        try:
            subjects = read(file).subjects.astype(str)
            own = int((subjects == name).sum())
            like |= {one for one in subjects.tolist() if one_spelling(one) == one_spelling(name)} - {name}
            if 0 < own < len(subjects):
                _whole(file)
        except RecordingError as error:
            unread.append(str(error))
            continue
        if own:
            found[file] = own, len(subjects)
    models = {str(path): _learned(path, name) for path in sorted(args.models.glob("*.onnx"))}
    lines = [f"{file}: {own} of {every} recordings" for file, (own, every) in found.items()]
    lines = lines or [f"no recording of {name} was found"]
    lines += [f"recordings of {one!r} stay: is that the same participant?" for one in sorted(like)]
    lines += [f"not looked into: {reason}" for reason in unread]
    lines += [f"model {model}: {answer}" for model, answer in models.items()]
    lines += [] if models else [f"no model to ask: {args.models} holds no *.onnx"]
    for line in lines:
        say(line, to=sys.stderr if args.json else sys.stdout)
    done = bool(found) and not args.dry_run and (args.yes or _agreed(name))
    stay = []
    for file in found if done else ():
        try:
            _remove(file, name)
        except (RecordingError, OSError) as error:  # if a file stays, the others are still removed
            stay.append(str(error) if isinstance(error, RecordingError) else f"{file}: {error.strerror}")
            say(f"not removed: {stay[-1]}", to=sys.stderr)
    done = done and len(stay) < len(found)
    if args.json:
        files = [{"file": str(file), "recordings": own, "of": every} for file, (own, every) in found.items()]
        told = {"participant": name, "removed": done, "files": files, "not_removed": stay, "not_looked_into": unread}
        say_json(told | {"models": models})
    else:
        rest = "the rest is removed" if stay else "removed"
        say(f"{rest}; not looked for: copies, backups, caches and reports" if done else "nothing was removed")
    return 1 if unread or stay else 0


def _remove(file: Path, participant: str) -> None:
    recordings = read(file)
    others = np.flatnonzero(recordings.subjects.astype(str) != participant)
    if len(others):
        write(file, recordings.take(others))
    else:
        file.unlink()


def _files(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """The files, with those in folders and what `write` leaves in a power failure; and the folders that cannot be read.

    Links are followed, since a link does not hold the recordings.
    """
    for path in paths:
        if not path.exists():
            raise GesturedError(f"{path}: is not there; nothing was removed")
    found = {path.resolve(): None for path in paths if not path.is_dir()}
    unread: list[OSError] = []
    seen = set()  # folders; a link may lead back to one
    walks = [os.walk(path, onerror=unread.append, followlinks=True) for path in paths if path.is_dir()]
    for folder, folders, names in chain.from_iterable(walks):
        seen.add(os.path.realpath(folder))
        folders[:] = [inner for inner in sorted(folders) if os.path.realpath(Path(folder, inner)) not in seen]
        inside = [name for name in sorted(names) if name.endswith(".npz") or (name[0] == "." and ".npz." in name)]
        found |= dict.fromkeys(Path(folder, name).resolve() for name in inside)
    return list(found), [f"{error.filename}: {error.strerror}" for error in unread]


def _whole(file: Path) -> None:
    """Raise RecordingError if a file holds fields that would not be written again."""
    with zipfile.ZipFile(file) as archive:
        unknown = sorted(set(archive.namelist()) - FIELDS)
    if unknown:
        raise RecordingError(f"{file}: {unknown[0]}: is no field of the contract, and would be lost; take it out first")


def _learned(model: Path, participant: str) -> str:
    """What a model's file says of a participant of this pseudonym."""
    try:
        origins = said(model)
    except (ValueError, OSError) as error:
        return f"cannot be read: {error}"
    except ModuleNotFoundError as error:
        return f"cannot be asked: {error.name} is missing: pip install 'gestured[lab]', or make lab"
    if origins is None:
        return "does not say whose recordings it learned from"
    files = [one.file for one in origins if one_spelling(participant) in map(one_spelling, one.subjects)]
    if not files:
        return f"learned from no {participant}"
    return f"learned from a {participant}, in {', '.join(files)}; weights cannot forget: train it again without them"


def _agreed(participant: str) -> bool:
    if not sys.stdin.isatty():
        raise GesturedError("nobody can be asked here; expected --yes or --dry-run; nothing was removed")
    say_drawn(f"Remove participant {participant} from these files? It cannot be undone. (yes/no) ", end="")
    return sys.stdin.readline().strip().lower() == "yes"
