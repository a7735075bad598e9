"""Readings, the frames of serial sensors, and the base class of the protocols: bytes in, frames out."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MOST_TAXELS = 64 * 64  # the taxels of the largest grid
LINE_BYTES = 32 * MOST_TAXELS  # the longest packet or line; numbers in text have about 25 characters at most
WIDTHS = (8, 16)  # bits of counters in firmware that overflow; one of 32 bits wraps as OSC's does
LARGEST = float(np.finfo(np.float32).max)  # the largest count, since the daemon gets float32
NEAR = 16  # a counter that falls has overflowed if it is so few steps ahead, lost frames included; else it began anew
FEWEST = 3  # so many frames of another protocol are no accident


class Reading(NamedTuple):
    """One frame: (R, C) counts; the sensor's own counter and time (s since the epoch), if it has them."""

    values: NDArray[np.generic]
    counter: int | None = None
    moment: float | None = None


class Unwrapped:
    """A sensor's own frame counter of 8 or 16 bits, continued over its overflows."""

    def __init__(self) -> None:
        self._last, self._beyond = 0, 0

    def of(self, counter: int) -> int:
        """The counter as if it had never overflowed; call it for every frame of the sensor, in order."""
        for bits in WIDTHS:
            if counter < self._last < 2**bits and counter + 2**bits - self._last <= NEAR:
                self._beyond += 2**bits
        self._last = counter
        return counter + self._beyond


class Protocol(ABC):
    """A decoder of the bytes of one connection. `passed` counts the bytes that belong to no frame."""

    baud = 115_200
    grid = (9, 9)  # default rows and columns
    fixed = False  # whether there is no other grid
    request = b""  # the bytes that request the next frame; empty if the sensor sends by itself

    def __init__(self, rows: int, columns: int) -> None:
        self.shape = (rows, columns)
        self.taxels = rows * columns
        self.passed = 0
        self._buffer = bytearray()

    @abstractmethod
    def push(self, data: bytes) -> list[Reading]:
        """The frames that these bytes complete, in order."""

    def flush(self) -> list[Reading]:
        """The frame that is complete because the line is quiet now, if any."""
        return []

    @staticmethod
    @abstractmethod
    def fits(data: bytes) -> str | None:
        """What the bytes look like, such as "csv with 81 numbers a line"; None if not like this protocol."""

    def _ended(self, data: bytes, end: bytes) -> list[bytes]:
        """The bytes before each `end`. The rest is kept, unless it is longer than any packet or line."""
        self._buffer += data
        *whole, rest = bytes(self._buffer).split(end)
        self._buffer = bytearray(rest)
        if len(rest) > LINE_BYTES:
            self._pass(len(rest))
        return whole

    def _pass(self, count: int) -> None:
        """Drop so many bytes at the front, which belong to no frame."""
        self.passed += count
        del self._buffer[:count]


def reading_of(found: Sequence[object], shape: tuple[int, int], dtype: np.dtype[np.generic]) -> Reading | None:
    """A frame of R x C numbers, with a frame counter in front or without; None for anything else."""
    extra = len(found) - shape[0] * shape[1]
    if extra not in (0, 1):
        return None
    values = np.array(found[extra:], dtype=dtype.newbyteorder("=")).reshape(shape)
    if not (abs(values.astype(float)) <= LARGEST).all():  # also false for NaN
        return None
    if extra == 0:
        return Reading(values)
    first = found[0]
    if not isinstance(first, int | float) or not math.isfinite(first) or first != int(first):
        return None
    return Reading(values, int(first))
