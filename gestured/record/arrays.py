"""The files of recordings: the contract's .npz, without pickles, readable with NumPy alone.

A file may be damaged or hostile. So its unpacked size is bounded before anything is unpacked, NumPy checks each member
against its header, and every field is checked against the contract (`check`). A fault is a `RecordingError` with the
file, the field, the recording, and what was expected.
"""

import zipfile
from dataclasses import fields
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import RecordingError
from gestured.record.check import Wrong, check, no_seconds
from gestured.record.files import PRIVATE, atomic_write, open_regular
from gestured.record.recordings import Recordings

MAX_RECORDING_BYTES = 2 << 30  # unpacked
_FIELDS = tuple(field.name for field in fields(Recordings))
_REQUIRED = _FIELDS[:5]


def read(path: str | Path) -> Recordings:
    """Read and check a file; unknown members are ignored. Raises RecordingError for a file that is no recording."""
    try:
        found = _load(path)
        check(found)
    except Wrong as error:
        raise RecordingError(f"{path}: {error}") from error
    return found


def read_timed(path: str | Path) -> Recordings:
    """As `read`; raises RecordingError also if the times are no seconds, for whoever counts by the hour."""
    found = read(path)
    for i in range(len(found)):
        if wrong := no_seconds(found.times_of(i)):
            raise RecordingError(f"{path}: times of recording {i}: {wrong}; are these seconds?")
    return found


def write(path: str | Path, recordings: Recordings) -> None:
    """Check recordings and write them, all or nothing; equal ones give equal bytes. Raises RecordingError."""
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
        raise RecordingError(f"{path}: cannot be written: {_brief(error)}") from error


def _load(path: str | Path) -> Recordings:
    """A file's fields before the check; raises Wrong."""
    try:
        with open_regular(path) as file, zipfile.ZipFile(file) as archive:
            held = {member.filename.removesuffix(".npy") for member in archive.infolist()}
            total = sum(member.file_size for member in archive.infolist())
            if total > MAX_RECORDING_BYTES:
                raise Wrong(f"unpacks to {total} bytes, expected at most {MAX_RECORDING_BYTES}")
            if missing := [field for field in _REQUIRED if field not in held]:
                raise Wrong(f"{missing[0]}: is missing, expected the fields {', '.join(_REQUIRED)}")
            return Recordings(**{field: _array(archive, field) for field in _FIELDS if field in held})
    except Wrong:
        raise
    except Exception as error:  # of a damaged archive zipfile raises a dozen types
        raise Wrong(f"cannot be read as a recording (.npz): {_brief(error)}") from error


def _array(archive: zipfile.ZipFile, field: str) -> NDArray[Any]:
    """A field's values in this machine's byte order, swapped in place since they may be large."""
    try:
        with archive.open(f"{field}.npy") as member:
            array: NDArray[Any] = np.lib.format.read_array(member, allow_pickle=False)
    except Exception as error:  # of a damaged member zipfile and NumPy raise a dozen types
        raise Wrong(f"{field}: is damaged: {_brief(error)}") from error
    return array if array.dtype.isnative else array.byteswap(inplace=True).view(array.dtype.newbyteorder("="))


def _brief(error: BaseException) -> str:
    """The text of a foreign exception, in one short line."""
    return getattr(error, "strerror", None) or " ".join(str(error).split())[:200] or type(error).__name__


def _pack(file: IO[bytes], recordings: Recordings) -> None:
    with zipfile.ZipFile(file, "w") as archive:
        for field, value in recordings.present():
            info = zipfile.ZipInfo(f"{field}.npy", (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = PRIVATE << 16
            with archive.open(info, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(value), allow_pickle=False)
