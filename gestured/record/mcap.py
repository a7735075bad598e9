"""The records of an MCAP file (mcap.dev/spec) that may be cut off, damaged or hostile.

The mcap library takes a record apart, once it lies in memory whole; it believes whatever size stands in a file. So each
record's size, what its chunk unpacks to, and the sum of all chunks are held against a bound before.
"""

import io
import os
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

MAGIC = b"\x89MCAP0\r\n"
RECORD_BYTES = 16 << 20  # of one record, and of what a chunk unpacks to; ours have little more than a mebibyte
TEXT_BYTES = 8 << 20  # of one channel or metadata record; a scene may hold a user's own gestures
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


def records(file: BinaryIO, budget: Budget) -> Iterator[Any]:
    """The library's Channel, Message and Metadata records up to the footer; a chunk's stand in its place."""
    from mcap.records import Chunk, Footer  # who reads no tape need not wait for it

    if file.read(len(MAGIC)) != MAGIC:
        raise Damaged("expected an MCAP file")
    for record in _records(file):
        if isinstance(record, Chunk):
            data = _unpacked(record)
            budget.unpack(len(data))
            yield from _records(io.BytesIO(data))
        elif isinstance(record, Footer):
            break
        else:
            yield record
    if file.read(len(MAGIC)) != MAGIC:
        raise CutOff


def _records(file: BinaryIO) -> Iterator[Any]:
    """Those that a tape is made of, until the file's end; what else there is is passed over."""
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError
    from mcap.opcode import Opcode
    from mcap.records import Channel, Chunk, Footer, Message, Metadata

    kinds: dict[int, Any] = {
        Opcode.CHANNEL: Channel,
        Opcode.CHUNK: Chunk,
        Opcode.FOOTER: Footer,
        Opcode.METADATA: Metadata,
    }
    while head := file.read(9):
        if len(head) < 9:
            raise CutOff
        opcode, size = struct.unpack("<BQ", head)
        most = TEXT_BYTES if opcode in (Opcode.CHANNEL, Opcode.METADATA) else RECORD_BYTES
        if not opcode or size > most:
            raise Damaged(f"a record of type {opcode} and {size} bytes, expected one of 1 to 255 and at most {most}")
        content = file.read(size)
        if len(content) < size:
            raise CutOff
        if opcode != Opcode.MESSAGE and opcode not in kinds:
            continue
        stream = ReadDataStream(io.BytesIO(content))
        try:
            record = Message.read(stream, size) if opcode == Opcode.MESSAGE else kinds[opcode].read(stream)
        except (McapError, struct.error, UnicodeDecodeError) as error:
            raise Damaged(f"a record that cannot be read: {error}") from error
        yield record


def _unpacked(chunk: Any) -> bytes:
    """What is in a chunk; Damaged where that is not as long as it says."""
    import zstandard
    from mcap.stream_reader import CRCValidationError, get_chunk_data_stream

    size, packed = chunk.uncompressed_size, chunk.data
    if size > RECORD_BYTES:
        raise Damaged(f"a chunk unpacks to {size} bytes, expected at most {RECORD_BYTES}")
    if chunk.compression not in ("zstd", ""):
        raise Damaged(f"a chunk is packed as {chunk.compression[:20]!r}, expected zstd")
    try:
        told = zstandard.frame_content_size(packed) if chunk.compression else len(packed)
        if told not in (size, -1):  # the library unpacks as much as this says; nothing said (-1), as the chunk says
            raise Damaged(f"a chunk unpacks to {told} bytes, expected its {size}")
        stream, found = get_chunk_data_stream(chunk, validate_crc=True)
    except (zstandard.ZstdError, CRCValidationError) as error:
        raise Damaged(f"a chunk cannot be unpacked: {error}") from error
    if found != size:
        raise Damaged(f"a chunk unpacks to {found} bytes, expected its {size}")
    return stream.read(size)
