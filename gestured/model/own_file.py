"""The file of the user's own gestures, the one file that the daemon writes: JSON, mode 0600, all of it or nothing."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from gestured.core.errors import GesturedError
from gestured.core.own import Examples, from_dict, to_dict
from gestured.record.files import PRIVATE, atomic_write, open_regular

FORMAT = 1
MAX_BYTES = 8 << 20  # the longest examples of as many gestures as there may be take some 5 MiB
MOST_MARKS = 4096  # brackets and commas; as many examples as there may be take some 1,100
NAME = "own-gestures.json"
REMEDY = "set own_gestures = FILE (--own-gestures FILE), or start it with systemd's StateDirectory="


class OwnFileError(GesturedError):
    """The file of own gestures cannot be read or written; the text names it."""


class OwnFile(NamedTuple):
    """A file, and what was found in it."""

    path: Path | None
    gestures: Examples
    fault: str | None  # why it cannot be read: the model's gestures go on without it


def where(chosen: Path | None, environ: Mapping[str, str]) -> Path | None:
    """The file that was set, else the one in systemd's state directory, else None."""
    if chosen is not None:
        return chosen
    directory = environ.get("STATE_DIRECTORY")
    return Path(directory.split(":")[0]) / NAME if directory else None


def load(path: Path | None) -> OwnFile:
    """Read the file; there are no gestures where there is none, or where it cannot be read."""
    try:
        return OwnFile(path, _read(path), None)
    except OwnFileError as error:
        return OwnFile(path, {}, str(error))


def _read(path: Path | None) -> Examples:
    if path is None:
        return {}
    try:
        with open_regular(path) as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise OwnFileError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(data) > MAX_BYTES:
        raise OwnFileError(f"{path}: expected at most {MAX_BYTES} bytes")
    try:
        # What reads JSON lets no other thread run before its end, and millions of empty lists fit into the bytes.
        if sum(map(data.count, (b"[", b"{", b","))) > MOST_MARKS:
            raise ValueError(f"expected at most {MOST_MARKS} brackets and commas")
        told = json.loads(data)
        if not isinstance(told, dict) or told.get("format") != FORMAT:
            raise ValueError(f"expected a JSON object with format {FORMAT}")
        return from_dict(told.get("gestures"))
    except (ValueError, RecursionError) as error:
        raise OwnFileError(f"{path}: is no file of own gestures: {error}") from error


def write(path: Path, gestures: Examples, sha256: str) -> None:
    """Put them there, with the digest of the model that they were enrolled with. Raises OwnFileError."""
    told = {"format": FORMAT, "model": sha256, "gestures": to_dict(gestures)}
    try:
        with atomic_write(path, PRIVATE) as file:
            file.write(json.dumps(told, indent=1, allow_nan=False).encode() + b"\n")
    except OSError as error:
        raise OwnFileError(f"{path}: cannot be written: {error.strerror}; nothing has changed") from error
