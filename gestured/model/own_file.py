"""The file of the user's own gestures, the one file that the daemon writes: JSON, mode 0600, all of it or nothing."""

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from gestured.core.errors import GesturedError
from gestured.core.own import Examples, from_dict, to_dict
from gestured.record.files import PRIVATE, atomic_write, open_regular

FORMAT = 1
MAX_BYTES = 8 << 20  # the most gestures, with the longest examples, take some 5 MiB
MOST_MARKS = 4096  # the most brackets and commas; the most gestures with the most examples take some 1,100
NAME = "own-gestures.json"
REMEDY = "set own_gestures = FILE (--own-gestures FILE)"
NO_FILE = f"there is no file for own gestures, since there is no home: {REMEDY}"


class OwnFileError(GesturedError):
    """The file of own gestures cannot be read or written; the text names it."""


class OwnFile(NamedTuple):
    """A file of own gestures, and what was found in it."""

    path: Path | None
    gestures: Examples
    fault: str | None = None  # why the file cannot be read; the model's gestures go on without it
    sha256: str = ""  # of its bytes; empty if there is no file


def where(chosen: Path | None, environ: Mapping[str, str]) -> Path | None:
    """The path that was set, else one in the state directory of systemd, else of the session or the home, else None."""
    if chosen is not None:
        return chosen
    if directory := environ.get("STATE_DIRECTORY"):
        return Path(directory.split(":")[0]) / NAME
    if not os.path.isabs(state := environ.get("XDG_STATE_HOME", "")):
        home = environ.get("HOME", "")
        state = os.path.join(home, ".local/state") if os.path.isabs(home) else ""
    return Path(state, "gestured", NAME) if state else None


def load(path: Path | None, known: OwnFile | None = None) -> OwnFile:
    """Read the file; without a file, or if it cannot be read, there are no gestures.

    For a file that has not changed, `known` is returned, so that its examples stay the same objects.
    """
    try:
        data = _read(path)
        if data is None:
            return OwnFile(path, {})
        sha256 = hashlib.sha256(data).hexdigest()
        if known is not None and (known.path, known.sha256) == (path, sha256):
            return known
        return OwnFile(path, _parse(data), None, sha256)
    except (OwnFileError, ValueError, RecursionError) as error:
        words = error if isinstance(error, OwnFileError) else f"{path}: is no file of own gestures: {error}"
        return OwnFile(path, {}, str(words))


def _read(path: Path | None) -> bytes | None:
    """The file's bytes, None if there is no file. Raises OwnFileError."""
    if path is None:
        return None
    try:
        with open_regular(path) as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OwnFileError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(data) > MAX_BYTES:
        raise OwnFileError(f"{path}: expected at most {MAX_BYTES} bytes")
    return data


def _parse(data: bytes) -> Examples:
    # Millions of empty lists fit into the bytes, and Python's JSON reader lets no other thread run before its end.
    if sum(map(data.count, (b"[", b"{", b","))) > MOST_MARKS:
        raise ValueError(f"expected at most {MOST_MARKS} brackets and commas")
    told = json.loads(data)
    if not isinstance(told, dict) or told.get("format") != FORMAT:
        raise ValueError(f"expected a JSON object with format {FORMAT}")
    return from_dict(told.get("gestures"))


def write(path: Path, gestures: Examples, model: str) -> OwnFile:
    """Write these gestures, with the digest of the `model` that compares them now. Raises OwnFileError."""
    told = {"format": FORMAT, "model": model, "gestures": to_dict(gestures)}
    data = json.dumps(told, indent=1, allow_nan=False).encode() + b"\n"
    try:
        with atomic_write(path, PRIVATE) as file:
            file.write(data)
    except OSError as error:
        raise OwnFileError(f"{path}: cannot be written: {error.strerror}") from error
    return OwnFile(path, gestures, None, hashlib.sha256(data).hexdigest())
