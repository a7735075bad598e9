"""Archives of arrays (.npz) that may be damaged or hostile: looked at as a whole first, then unpacked array by array.

NumPy reads the arrays. It believes what a header says, and zipfile what the list of members says; so both are held
against each other and a bound before. Whatever is wrong is `Wrong`, with the field.
"""

import io
import math
import struct
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from gestured.record.check import CHARACTERS, Wrong

DIRECTORY_BYTES = 64 << 10  # bytes of the list of members; a recording's has less than two thousand
HEADER_BYTES = 16 << 10  # bytes of an array's header; NumPy itself takes no more than 10,000
ITEM_BYTES = 4 * CHARACTERS  # bytes of one number or text
# The end of an archive's directory, and what stands before it where there is another, larger one.
_END, _END_BYTES, _LOCATOR, _LOCATOR_BYTES = b"PK\x05\x06", 22, b"PK\x06\x07", 20
_READ_HEADER = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


class Archive:
    """The arrays of an open file. Nothing is unpacked but headers before all of them together are known to fit."""

    def __init__(self, file: BinaryIO, fields: frozenset[str], max_bytes: int) -> None:
        """Members that are none of `fields` are passed over."""
        _check_directory(file)
        self._zip = zipfile.ZipFile(file)
        members = _members(self._zip, fields)
        total = sum(info.file_size for info in members.values())
        if total > max_bytes:
            raise Wrong(f"unpacks to {total} bytes, expected at most {max_bytes}")
        # Of each field an array of its type and shape that holds zeros and takes no memory.
        self.forms = {field: self._form(field, info.file_size) for field, info in members.items()}

    def array(self, field: str) -> NDArray[Any]:
        """A field's values, in this machine's byte order; in memory they are only once."""
        with self._opened(field) as member:
            array: NDArray[Any] = npy.read_array(member, allow_pickle=False)
        return array if array.dtype.isnative else array.byteswap(inplace=True).view(array.dtype.newbyteorder("="))

    def _form(self, field: str, size: int) -> NDArray[Any]:
        with self._opened(field) as member, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # a header may be as Python 2 wrote it
            start = io.BytesIO(member.read(HEADER_BYTES))
            version = npy.read_magic(start)
            if version not in _READ_HEADER:
                raise Wrong(f"expected version 1 or 2 of NumPy's format, found {version}")
            shape, _, dtype = _READ_HEADER[version](start)
            if dtype.kind not in "iufU" or not 0 < dtype.itemsize <= ITEM_BYTES:
                raise Wrong(f"expected numbers or text of at most {ITEM_BYTES} bytes, found {dtype}")
            expected, held = math.prod(shape) * dtype.itemsize, size - start.tell()
            if any(n < 0 for n in shape) or expected != held:
                raise Wrong(f"expected {expected} bytes for the shape {shape}, found {held}")
            return np.broadcast_to(np.zeros((), dtype.newbyteorder("=")), shape)

    @contextmanager
    def _opened(self, field: str) -> Iterator[Any]:
        """A member; what is wrong with it names the field."""
        try:
            with self._zip.open(f"{field}.npy") as member:
                yield member
        except Wrong as error:
            raise Wrong(f"{field}: {error}", field) from error
        except Exception as error:  # of a damaged file zipfile and NumPy raise a dozen types
            raise Wrong(f"{field}: is damaged: {brief(error)}", field) from error


def _check_directory(file: BinaryIO) -> None:
    """Wrong where the list of members is larger than that of any recording: zipfile reads all of it."""
    size = file.seek(0, io.SEEK_END)
    file.seek(max(size - _END_BYTES - _LOCATOR_BYTES, 0))
    before, end = (tail := file.read())[:-_END_BYTES], tail[-_END_BYTES:]
    if not end.startswith(_END) or not end.endswith(b"\0\0") or before.startswith(_LOCATOR):
        raise Wrong(
            "cannot be read as a recording (.npz): expected a zip archive without a comment, of less than 4 GiB"
        )
    (listed,) = struct.unpack_from("<I", end, 12)
    if listed > DIRECTORY_BYTES:
        raise Wrong(f"its list of members has {listed} bytes, expected at most {DIRECTORY_BYTES}")


def _members(archive: zipfile.ZipFile, fields: frozenset[str]) -> dict[str, zipfile.ZipInfo]:
    """Field -> its member."""
    seen: set[str] = set()
    members = {}
    for info in archive.infolist():
        name = info.orig_filename
        field = name.removesuffix(".npy")
        if name in seen:
            raise Wrong(f"{field if field in fields else name}: is there twice", field if field in fields else "")
        seen.add(name)
        if "/" in name or "\\" in name:
            raise Wrong(f"{name!r}: expected names without folders")
        if field in fields and field != name:
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise Wrong(f"{field}: expected it stored or deflated", field)
            members[field] = info
    return members


def brief(error: BaseException) -> str:
    """What an exception of somebody else's says, in one short line."""
    return getattr(error, "strerror", None) or " ".join(str(error).split())[:200] or type(error).__name__
