"""One frame that a serial sensor sent, and what every protocol does: bytes in, frames out."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MOST_TAXELS = 64 * 64  # of the largest grid
LINE_BYTES = 32 * MOST_TAXELS  # of the longest packet or line; numbers in text have up to some 25 characters
WIDTHS = (8, 16)  # bits of a counter in firmware; one of 32 bits wraps as OSC's does
LARGEST = float(np.finfo(np.float32).max)  # of a count: it goes to the daemon as float32
NEAR = 16  # frames that may be lost where a counter wraps; one that falls further began anew
FEWEST = 3  # frames of another protocol that are no accident


class Reading(NamedTuple):
    """One frame: (R, C) counts; the sensor's own counter and time (s since the epoch) where it has them."""

    values: NDArray[np.generic]
    counter: int | None = None
    moment: float | None = None


class Unwrapped:
    """A sensor's own frame counter: one of 8 or 16 bits that overflows goes on, as one of 32 bits does."""

    def __init__(self) -> None:
        self._last, self._beyond = 0, 0

    def of(self, counter: int) -> int:
        """The counter as if it had never overflowed; to be asked with each of the sensor's frames, in their order."""
        for bits in WIDTHS:
            if counter < self._last < 2**bits and counter + 2**bits - self._last <= NEAR:
                self._beyond += 2**bits
        self._last = counter
        return counter + self._beyond


class Protocol(ABC):
    """The bytes of one connection. `passed` counts those that belong to no frame."""

    baud = 115_200
    grid = (9, 9)  # rows and columns, unless told
    fixed = False  # whether there are no others
    request = b""  # what asks for the next frame; empty where the sensor speaks by itself

    def __init__(self, rows: int, columns: int) -> None:
        self.shape = (rows, columns)
        self.taxels = rows * columns
        self.passed = 0
        self._buffer = bytearray()

    @abstractmethod
    def push(self, data: bytes) -> list[Reading]:
        """The frames that are complete with these bytes, in order."""

    def flush(self) -> list[Reading]:
        """The frame that is complete where the line is quiet now."""
        return []

    @staticmethod
    @abstractmethod
    def fits(data: bytes) -> str | None:
        """What these bytes look like, such as "csv with 81 numbers a line"; None where not like this protocol."""

    def _ended(self, data: bytes, end: bytes) -> list[bytes]:
        """What stands before each `end`; what has no end yet waits, unless it is longer than any packet or line."""
        self._buffer += data
        *whole, rest = bytes(self._buffer).split(end)
        self._buffer = bytearray(rest)
        if len(rest) > LINE_BYTES:
            self._pass(len(rest))
        return whole

    def _pass(self, count: int) -> None:
        """So many bytes at the front belong to no frame."""
        self.passed += count
        del self._buffer[:count]


def reading_of(found: Sequence[object], shape: tuple[int, int], dtype: np.dtype[np.generic]) -> Reading | None:
    """A frame of so many numbers, or one more in front that counts frames; None for any other number of them."""
    extra = len(found) - shape[0] * shape[1]
    if extra not in (0, 1):
        return None
    values = np.array(found[extra:], dtype=dtype.newbyteorder("=")).reshape(shape)
    if not (abs(values.astype(float)) <= LARGEST).all():  # nor are infinities, and what is no number
        return None
    if extra == 0:
        return Reading(values)
    first = found[0]
    if not isinstance(first, int | float) or not math.isfinite(first) or first != int(first):
        return None
    return Reading(values, int(first))
