"""Archives of arrays (.npz) that may be damaged or hostile: looked at as a whole first, then unpacked array by array.

Whatever is wrong is `Wrong`, with the field.
"""

import io
import math
import struct
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gestured.record.check import CHARACTERS, Wrong

DIRECTORY_BYTES = 64 << 10  # bytes of the list of members; a recording's has less than two thousand
HEADER_BYTES = 16 << 10  # bytes of an array's header; NumPy itself takes no more than 10,000
ITEM_BYTES = 4 * CHARACTERS  # bytes of one number or text
UNPACK_BYTES = 1 << 20  # bytes that are unpacked at once
# The end of an archive's directory, and what stands before it where there is another, larger one.
_END, _END_BYTES, _LOCATOR, _LOCATOR_BYTES = b"PK\x05\x06", 22, b"PK\x06\x07", 20


@dataclass(frozen=True, slots=True)
class Header:
    """What a member says of its array."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    fortran: bool
    begin: int  # bytes before the values

    @property
    def size(self) -> int:
        """Bytes of the values."""
        return math.prod(self.shape) * self.dtype.itemsize

    def stand_in(self) -> NDArray[Any]:
        """An array of that form that holds zeros and takes no memory."""
        return np.broadcast_to(np.zeros((), self.dtype.newbyteorder("=")), self.shape)


class Archive:
    """The arrays of an open file. Nothing is unpacked but headers before all of them together are known to fit."""

    def __init__(self, file: BinaryIO, fields: frozenset[str], max_bytes: int) -> None:
        """Members that are none of `fields` are passed over."""
        _check_directory(file)
        self._zip = zipfile.ZipFile(file)
        self._members = _members(self._zip, fields)
        total = sum(info.file_size for info in self._members.values())
        if total > max_bytes:
            raise Wrong(f"unpacks to {total} bytes, expected at most {max_bytes}")
        self.headers: Mapping[str, Header] = {field: self._header(field) for field in self._members}

    def array(self, field: str) -> NDArray[Any]:
        """A field's values, in this machine's byte order; in memory they are only once."""
        header = self.headers[field]
        values = np.empty(header.size, np.uint8)
        with self._opened(field) as member:
            member.read(header.begin)
            done = 0
            while done < len(values) and (piece := member.read(min(UNPACK_BYTES, len(values) - done))):
                values[done : done + len(piece)] = np.frombuffer(piece, np.uint8)
                done += len(piece)
            if done < len(values) or member.read(1):
                more = "fewer" if done < len(values) else "more"
                raise Wrong(f"expected {len(values)} bytes for the shape {header.shape}, found {more}")
        array = values.view(header.dtype)
        if not header.dtype.isnative:
            array = array.byteswap(inplace=True).view(header.dtype.newbyteorder("="))
        return array.reshape(header.shape, order="F" if header.fortran else "C")

    def _header(self, field: str) -> Header:
        with self._opened(field) as member, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # a header may be as Python 2 wrote it
            start = io.BytesIO(member.read(HEADER_BYTES))
            version = np.lib.format.read_magic(start)
            if version == (1, 0):
                shape, fortran, dtype = np.lib.format.read_array_header_1_0(start)
            elif version == (2, 0):
                shape, fortran, dtype = np.lib.format.read_array_header_2_0(start)
            else:
                raise Wrong(f"expected version 1 or 2 of NumPy's format, found {version}")
            header = Header(dtype, shape, fortran, start.tell())
            if dtype.kind not in "iufU" or not dtype.itemsize:
                raise Wrong(f"expected numbers or text, found {dtype}")
            if dtype.itemsize > ITEM_BYTES:  # before a stand-in holds one
                raise Wrong(f"expected at most {ITEM_BYTES} bytes for a number or a text, found {dtype}")
            held = self._members[field].file_size - header.begin
            if any(n < 0 for n in shape) or header.size != held:
                raise Wrong(f"expected {header.size} bytes for the shape {shape}, found {held}")
            return header

    @contextmanager
    def _opened(self, field: str) -> Iterator[Any]:
        """A member; what is wrong with it names the field."""
        info = copy(self._members[field])
        info.file_size += 1  # one byte more than it should have is seen, where there is one
        try:
            with self._zip.open(info) as member:
                yield member
        except Wrong as error:
            raise Wrong(f"{field}: {error}", field) from error
        except Exception as error:  # of a damaged file zipfile and NumPy's header parser raise a dozen types
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
        if field not in fields or field == name:
            continue
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise Wrong(f"{field}: expected it stored or deflated", field)
        if info.compress_type == zipfile.ZIP_STORED and info.compress_size != info.file_size:
            raise Wrong(f"{field}: is damaged: expected {info.file_size} bytes, found {info.compress_size}", field)
        members[field] = info
    return members


def brief(error: BaseException) -> str:
    """What an exception of somebody else's says, in one short line."""
    return getattr(error, "strerror", None) or " ".join(str(error).split())[:200] or type(error).__name__
