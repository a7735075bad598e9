"""The records of an MCAP file (mcap.dev/spec) that may be cut off, damaged or hostile.

The mcap library parses records and chunks that lie in memory whole, and believes any size that a file states. So the
size of each record, the unpacked size of each chunk, and the memory for all of them are checked against bounds before.
"""

import io
import os
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

MAGIC = b"\x89MCAP0\r\n"
RECORD_BYTES = 8 << 20  # of one record, and of an unpacked chunk; ours have little more than a mebibyte
GROWTH = 500  # bytes of memory for a byte of the file; large, since frames of zeros are packed to next to nothing
GROWTH_BYTES = 64 << 20  # bytes of memory for any file, however small
KEPT_BYTES = 4 << 30  # bytes of memory at most, however large the file is
UNPACKED_COSTS = 0.25  # bytes of memory that an unpacked byte counts as, since also records that are not kept take time


class CutOff(Exception):
    """The file ends before its end was written."""


class Damaged(Exception):
    """A record that is damaged, though all records before it are good; the text says what is wrong."""


class TooLarge(Exception):
    """The file takes more memory than any honest one."""


class Budget:
    """The bytes of memory that a file may cost."""

    def __init__(self, file: BinaryIO) -> None:
        self._left: float = min(GROWTH_BYTES + GROWTH * os.fstat(file.fileno()).st_size, KEPT_BYTES)

    def spend(self, count: float) -> None:
        """Count bytes that stay in memory. Raises TooLarge if the budget is spent."""
        self._left -= count
        if self._left < 0:
            raise TooLarge("needs more memory than a recording of its size does; expected a shorter recording")


def records(file: BinaryIO, budget: Budget) -> Iterator[Any]:
    """The Channel, Message and Metadata records up to the footer, also of chunks. Raises CutOff, Damaged, TooLarge."""
    from mcap.data_stream import ReadDataStream  # a slow import, which only tapes need
    from mcap.exceptions import McapError
    from mcap.opcode import Opcode
    from mcap.records import Channel, Chunk, Message, Metadata
    from mcap.stream_reader import CRCValidationError
    from zstandard import ZstdError

    if file.read(len(MAGIC)) != MAGIC:
        raise Damaged("expected an MCAP file")
    opcode = 0
    while opcode != Opcode.FOOTER:
        opcode, size = struct.unpack("<BQ", _whole(file, 9))
        if not opcode or size > RECORD_BYTES:
            raise Damaged(f"a record of type {opcode} and {size} bytes, expected 1 to 255 and at most {RECORD_BYTES}")
        stream = ReadDataStream(io.BytesIO(_whole(file, size)))
        try:
            if opcode == Opcode.CHUNK:
                yield from _unpacked(Chunk.read(stream), budget)
            elif opcode == Opcode.MESSAGE:
                yield Message.read(stream, size)
            elif opcode in (Opcode.CHANNEL, Opcode.METADATA):
                yield (Channel if opcode == Opcode.CHANNEL else Metadata).read(stream)
        except (McapError, ZstdError, CRCValidationError, struct.error, UnicodeDecodeError) as error:
            raise Damaged(f"a record that cannot be read: {error}") from error
    if _whole(file, len(MAGIC)) != MAGIC:
        raise CutOff


def _whole(file: BinaryIO, size: int) -> bytes:
    """The next `size` bytes. Raises CutOff if the file ends before."""
    data = file.read(size)
    if len(data) < size:
        raise CutOff
    return data


def _unpacked(chunk: Any, budget: Budget) -> list[Any]:
    """The records of a chunk. Raises Damaged if it unpacks to another size than it states."""
    from mcap.stream_reader import breakup_chunk
    from zstandard import frame_content_size

    size, packed = chunk.uncompressed_size, chunk.data
    if chunk.compression not in ("zstd", ""):
        raise Damaged(f"a chunk is packed as {chunk.compression[:20]!r}, expected zstd")
    told = frame_content_size(packed) if chunk.compression else len(packed)
    if size > RECORD_BYTES or told not in (size, -1):  # without a told size (-1), at most `size` is unpacked
        raise Damaged(f"a chunk unpacks to {told} bytes, expected its {size}, and at most {RECORD_BYTES}")
    budget.spend(UNPACKED_COSTS * size)
    found: list[Any] = breakup_chunk(chunk, validate_crc=True)
    return found
