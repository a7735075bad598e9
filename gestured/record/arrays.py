"""Read and write recordings: the contract's .npz, without pickles, readable with NumPy alone.

A file may be damaged or hostile: its members are measured before they are unpacked (`npz`), and every field is held
against the contract (`check`), the frames last. What is wrong is one `RecordingError`: file, field,
recording, and what was expected.
"""

import zipfile
from dataclasses import fields
from pathlib import Path
from typing import IO

import numpy as np

from gestured.core.errors import RecordingError
from gestured.record.check import Wrong, check, check_all_but_frames, check_frames, shapes
from gestured.record.files import PRIVATE, atomic_write, open_regular
from gestured.record.npz import Archive, brief
from gestured.record.recordings import Recordings

MAX_RECORDING_BYTES = 2 << 30  # unpacked


_FIELDS = tuple(field.name for field in fields(Recordings))
_KNOWN = frozenset(_FIELDS)
_REQUIRED = _FIELDS[:5]


def read(path: str | Path) -> Recordings:
    """Read and check a file; RecordingError for what is no recording. It ignores unknown members."""
    try:
        found = _load(path)
        check_frames(found)
    except Wrong as error:
        raise RecordingError(f"{path}: {error}") from error
    return found


def write(path: str | Path, recordings: Recordings) -> None:
    """Check and write: all or nothing, the same bytes for the same recordings. Raises RecordingError."""
    path = Path(path)
    try:
        check(recordings)
        total = sum(value.nbytes for _, value in recordings.present())
        if total > MAX_RECORDING_BYTES:
            raise Wrong(f"unpacks to {total} bytes, expected at most {MAX_RECORDING_BYTES}")
        with atomic_write(path) as file:
            _pack(file, recordings)
    except Wrong as error:
        raise RecordingError(f"{path}: not written: {error}") from error
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {brief(error)}") from error


def _load(path: str | Path) -> Recordings:
    """A file's fields, checked but for the frames, which are unpacked last; raises Wrong."""
    try:
        with open_regular(path) as file:
            archive = Archive(file, _KNOWN, MAX_RECORDING_BYTES)
            forms = archive.forms
            missing = [field for field in _REQUIRED if field not in forms]
            if missing:
                raise Wrong(f"{missing[0]}: is missing, expected the fields {', '.join(_REQUIRED)}", missing[0])
            shapes(Recordings(**forms))
            fields = {field: archive.array(field) for field in forms if field != "frames"}
            check_all_but_frames(Recordings(frames=forms["frames"], **fields))
            return Recordings(frames=archive.array("frames"), **fields)
    except Wrong:
        raise
    except Exception as error:  # of a damaged file zipfile raises a dozen types
        raise Wrong(f"cannot be read as a recording (.npz): {brief(error)}") from error


def _pack(file: IO[bytes], recordings: Recordings) -> None:
    with zipfile.ZipFile(file, "w") as archive:
        for field, value in recordings.present():
            info = zipfile.ZipInfo(f"{field}.npy", (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = PRIVATE << 16
            with archive.open(info, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(value), allow_pickle=False)
