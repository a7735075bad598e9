"""The records of an MCAP file (mcap.dev/spec) that may be cut off, damaged or hostile.

No size that a file says is believed before it is held against a bound: not a record's, not a chunk's, not what all
chunks unpack to. The library that writes our files reads whatever a size says.
"""

import io
import os
import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO

MAGIC = b"\x89MCAP0\r\n"
FOOTER, CHANNEL, MESSAGE, CHUNK, METADATA = 2, 4, 5, 6, 12  # opcodes
RECORD_BYTES = 16 << 20  # of one record, and of what a chunk unpacks to; ours have little more than a mebibyte
GROWTH = 500  # bytes of memory for a byte of the file: an idle sensor that sends zeros leaves next to nothing
GROWTH_BYTES = 64 << 20  # bytes of memory for any file, however small
KEPT_BYTES = 4 << 30  # bytes of memory at most, however large the file is
PASSED_OVER = 4  # bytes that are unpacked for one that may be kept: nothing is kept of the pictures


class CutOff(Exception):
    """The file ends before its end was written."""


class Damaged(Exception):
    """What is wrong with a record; what comes before it is good."""


class TooLarge(Exception):
    """The file becomes larger than any honest one."""


class Budget:
    """What a file may become, in bytes; whoever takes more is told TooLarge."""

    def __init__(self, file: BinaryIO) -> None:
        allowed = GROWTH_BYTES + GROWTH * os.fstat(file.fileno()).st_size
        self._kept, self._unpacked = min(allowed, KEPT_BYTES), PASSED_OVER * allowed

    def keep(self, count: int) -> None:
        """So many bytes stay in memory."""
        self._kept -= count
        if self._kept < 0:
            raise TooLarge("needs more memory than a recording of its size does; expected a shorter recording")

    def unpack(self, count: int) -> None:
        """So many bytes were unpacked."""
        self._unpacked -= count
        if self._unpacked < 0:
            raise TooLarge("unpacks to more than a recording of its size does")


def records(file: BinaryIO, budget: Budget) -> Iterator[tuple[int, bytes]]:
    """(opcode, content) of each record up to the footer; a chunk's stand in its place."""
    if file.read(len(MAGIC)) != MAGIC:
        raise Damaged("expected an MCAP file")
    for opcode, content in _framed(file):
        if opcode == CHUNK:
            data = _unpacked(content)
            budget.unpack(len(data))
            inside = io.BytesIO(data)
            while inside.tell() < len(data):
                yield _record(inside)
        else:
            yield opcode, content
        if opcode == FOOTER:
            break
    if file.read(len(MAGIC)) != MAGIC:
        raise CutOff


def _framed(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    while True:
        yield _record(file)


def _record(file: BinaryIO) -> tuple[int, bytes]:
    head = file.read(9)
    if len(head) < 9:
        raise CutOff
    opcode, size = struct.unpack("<BQ", head)
    if size > RECORD_BYTES:
        raise Damaged(f"a record of {size} bytes, expected at most {RECORD_BYTES}")
    content = file.read(size)
    if len(content) < size:
        raise CutOff
    return opcode, content


def _unpacked(chunk: bytes) -> bytes:
    """What is in a chunk: times, its size and checksum, how it is packed, the packed records."""
    fields = Fields(chunk)
    _, _, size, checksum = fields.take("<QQQI")
    compression = fields.text()
    packed = fields.rest(*fields.take("<Q"))
    if size > RECORD_BYTES:
        raise Damaged(f"a chunk unpacks to {size} bytes, expected at most {RECORD_BYTES}")
    try:
        data = _unpack(compression, packed, size + 1)
    except Damaged:
        raise
    except Exception as error:  # each library has errors of its own
        raise Damaged(f"a chunk cannot be unpacked: {error}") from error
    if len(data) != size or (checksum and zlib.crc32(data) != checksum):
        raise Damaged(f"a chunk does not unpack to its {size} bytes")
    return data


def _unpack(compression: str, packed: bytes, most: int) -> bytes:
    """At most so many bytes, whatever the packed ones say of themselves."""
    if compression == "":
        return packed
    if compression == "zstd":
        import zstandard

        decompressor = zstandard.ZstdDecompressor(max_window_size=RECORD_BYTES)
        with decompressor.stream_reader(packed) as stream:
            return stream.read(most)
    if compression == "lz4":
        import lz4.frame

        found: bytes = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=most)
        return found
    raise Damaged(f"a chunk is packed as {compression[:20]!r}, expected zstd or lz4")


class Fields:
    """The fields of one record, taken from its front. Damaged where it ends too early."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, 0

    def take(self, form: str) -> tuple[int, ...]:
        """Numbers, as `struct` writes them."""
        try:
            found = struct.unpack_from(form, self._content, self._at)
        except struct.error:
            raise Damaged("a record ends in the middle of a number") from None
        self._at += struct.calcsize(form)
        return found

    def rest(self, size: int | None = None) -> bytes:
        """So many bytes; all that is left unless told."""
        end = len(self._content) if size is None else self._at + size
        if end > len(self._content):
            raise Damaged(f"a record ends before {size} bytes that it says it has")
        found, self._at = self._content[self._at : end], end
        return found

    def text(self) -> str:
        """A string behind its length."""
        try:
            return self.rest(*self.take("<I")).decode()
        except UnicodeDecodeError:
            raise Damaged("a text that is no UTF-8") from None

    def pairs(self) -> dict[str, str]:
        """Strings by name, behind the length of all of them."""
        inside = Fields(self.rest(*self.take("<I")))
        found = {}
        while inside._at < len(inside._content):
            name = inside.text()
            found[name] = inside.text()
        return found
