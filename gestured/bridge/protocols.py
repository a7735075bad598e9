"""What sensors say on serial lines: bytes in, frames out. Pure: no device, no clock.

flexitac   AA 55, then rows x columns bytes, row by row, one byte a taxel; 2,000,000 baud, about 100 frames a second
           (WT-MM/PyFlexiTac: flexitac/protocol.py and firmware/profiles.py; CL-YQLM/flexitac-live: README.md).
e256       eTextile's 16 x 16 matrix: asked by the OSC message /r, it answers with /r and one blob of 256 bytes, both
           framed by SLIP; 230,400 baud (eTextile/Matrix: Firmware/main/transmit_osc.cpp and config.h).
osc-slip   OSC packets framed by SLIP (RFC 1055): of each, the first message that holds a frame, whatever its address.
csv        a line of numbers a frame, with commas, semicolons, tabs or spaces between them.

In osc-slip and csv one more leading number is the sensor's own frame counter.
"""

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import ProtocolError
from gestured.core.osc import decode
from gestured.core.osc_message import Message

MOST_TAXELS = 64 * 64  # of the largest grid
LINE_BYTES = 32 * MOST_TAXELS  # of the longest packet or line; numbers in text have up to some 25 characters
COUNTER = 0x7FFFFFFF  # a frame counter is an `i` of OSC
FEWEST = 3  # frames of another protocol that are no accident
MOST_LINES = 0.75  # of which are alike where the bytes are text
TRIED = 64  # markers that are tried as the first of a row of frames
BLOB_TYPES: dict[int, np.dtype[Any]] = {
    1: np.dtype("u1"),
    2: np.dtype(">u2"),
    4: np.dtype(">f4"),
}  # bytes a taxel -> what they are


class Reading(NamedTuple):
    """One frame: (R, C) counts; the sensor's own counter and time (s since the epoch) where it has them."""

    values: NDArray[np.generic]
    counter: int | None = None
    moment: float | None = None


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

    def _pass(self, count: int) -> None:
        """So many bytes at the front belong to no frame."""
        self.passed += count
        del self._buffer[:count]


class FlexiTac(Protocol):
    """Frames behind a marker that may occur in the data: it is one where the next stands a frame's length after it."""

    baud = 2_000_000
    grid = (16, 16)
    MARKER = b"\xaa\x55"

    def push(self, data: bytes) -> list[Reading]:
        """A frame is given once the marker of the next one is there: one that lost a byte is never given."""
        self._buffer += data
        found = []
        size = len(self.MARKER) + self.taxels
        while len(self._buffer) >= size + len(self.MARKER):
            if self._buffer.startswith(self.MARKER) and self._buffer.startswith(self.MARKER, size):
                found.append(self._take(size))
            else:
                self._pass(self._next_marker())
        return found

    def flush(self) -> list[Reading]:
        """A frame with nothing after it: between two frames the line is quiet for some milliseconds."""
        size = len(self.MARKER) + self.taxels
        if len(self._buffer) == size and self._buffer.startswith(self.MARKER):
            return [self._take(size)]
        return []

    def _take(self, size: int) -> Reading:
        values = np.frombuffer(bytes(self._buffer[len(self.MARKER) : size]), np.uint8).reshape(self.shape)
        del self._buffer[:size]
        return Reading(values)

    def _next_marker(self) -> int:
        """Where the next one is, behind the first byte; else where half of one may stand."""
        at = self._buffer.find(self.MARKER, 1)
        if at < 0:
            at = len(self._buffer) - self._buffer.endswith(self.MARKER[:1])
        return at

    @staticmethod
    def fits(data: bytes) -> str | None:
        """Markers at even distances."""
        places = [n for n in range(len(data) - 1) if data.startswith(FlexiTac.MARKER, n)]
        here = set(places)
        for at in places[:TRIED]:
            for after in places[:TRIED]:
                distance = after - at
                taxels = distance - len(FlexiTac.MARKER)
                if 4 <= taxels <= MOST_TAXELS and all(at + k * distance in here for k in range(FEWEST + 1)):
                    return f"flexitac with frames of {taxels} taxels"
        return None


class OscSlip(Protocol):
    """OSC packets between END bytes."""

    def push(self, data: bytes) -> list[Reading]:
        """A frame for each packet that holds one."""
        found = []
        for packet, raw in self._packets(data):
            reading = self._frame(packet)
            if reading is None:
                self.passed += raw
            else:
                found.append(reading)
        return found

    def _packets(self, data: bytes) -> list[tuple[bytes, int]]:
        """Each whole packet, and how many bytes it took."""
        self._buffer += data
        *whole, rest = bytes(self._buffer).split(SLIP_END)
        self._buffer = bytearray(rest)
        if len(rest) > LINE_BYTES:
            self._pass(len(rest))
        return [(slip_decoded(each), len(each)) for each in whole if each]

    def _frame(self, packet: bytes) -> Reading | None:
        for message in messages_of(packet):
            reading = self._values(message)
            if reading is not None:
                return reading._replace(moment=message.timetag)
        return None

    def _values(self, message: Message) -> Reading | None:
        *before, last = message.args or (None,)
        if isinstance(last, bytes):
            dtype = BLOB_TYPES.get(len(last) // self.taxels) if len(last) % self.taxels == 0 else None
            values: NDArray[Any] | None = None if dtype is None else np.frombuffer(last, dtype)
        elif isinstance(last, np.ndarray):
            values = last
        else:
            return None
        return None if values is None else reading_of([*before, *values.tolist()], self.shape, values.dtype)

    @staticmethod
    def fits(data: bytes) -> str | None:
        """Several packets that are OSC."""
        packets = [message for each in data.split(SLIP_END)[1:-1] for message in messages_of(slip_decoded(each))]
        return f"osc-slip with messages to {packets[0].address}" if len(packets) >= FEWEST else None


class E256(OscSlip):
    """Answers to /r."""

    baud = 230_400
    grid = (16, 16)
    fixed = True
    request = b"\xc0/r\0\0,\0\0\0\xc0"
    ANSWER = "/r"

    def _values(self, message: Message) -> Reading | None:
        blob = message.args[0] if len(message.args) == 1 else None
        if message.address != self.ANSWER or not isinstance(blob, bytes) or len(blob) != self.taxels:
            return None
        return Reading(np.frombuffer(blob, np.uint8).reshape(self.shape))

    @staticmethod
    def fits(data: bytes) -> str | None:
        """Several answers."""
        return "e256" if len(E256(*E256.grid).push(data)) >= FEWEST else None


class Csv(Protocol):
    """Lines of numbers."""

    _begun = False  # the first line may be the end of one

    def push(self, data: bytes) -> list[Reading]:
        """A frame for each line that holds one."""
        self._buffer += data
        *lines, rest = bytes(self._buffer).split(b"\n")
        self._buffer = bytearray(rest)
        if len(rest) > LINE_BYTES:
            self._pass(len(rest))
        found = []
        for line in lines:
            reading = reading_of(numbers(line), self.shape, np.dtype(float)) if self._begun else None
            self._begun = True
            if reading is not None:
                found.append(reading)
            elif line.strip():
                self.passed += len(line)
        return found

    @staticmethod
    def fits(data: bytes) -> str | None:
        """Lines of equally many numbers, but for some that are damaged."""
        lines = data.split(b"\n")[1:-1]
        ((count, often),) = Counter(len(numbers(line)) for line in lines).most_common(1) or [(0, 0)]
        if count >= 4 and often >= FEWEST and often >= MOST_LINES * len(lines):
            return f"csv with {count} numbers a line"
        return None


PROTOCOLS: dict[str, type[Protocol]] = {"flexitac": FlexiTac, "e256": E256, "osc-slip": OscSlip, "csv": Csv}

SLIP_END = b"\xc0"


def slip_decoded(packet: bytes) -> bytes:
    """A packet without its escapes."""
    return packet.replace(b"\xdb\xdc", b"\xc0").replace(b"\xdb\xdd", b"\xdb")


def messages_of(packet: bytes) -> list[Message]:
    """The OSC messages of a packet; none where it is no OSC."""
    try:
        return decode(packet)
    except ProtocolError:
        return []


def numbers(line: bytes) -> list[float]:
    """The numbers of a line of text; none where anything else is in it."""
    for separator in (b",", b";", b"\t"):
        line = line.replace(separator, b" ")
    try:
        return [float(word) for word in line.split()]
    except ValueError:
        return []


def reading_of(found: Sequence[object], shape: tuple[int, int], dtype: np.dtype[np.generic]) -> Reading | None:
    """A frame of so many numbers, or one more in front that counts frames; None for any other number of them."""
    extra = len(found) - shape[0] * shape[1]
    if extra not in (0, 1):
        return None
    values = np.array(found[extra:], dtype=dtype.newbyteorder("=")).reshape(shape)
    if not np.isfinite(values).all():
        return None
    if extra == 0:
        return Reading(values)
    first = found[0]
    if not isinstance(first, int | float) or not math.isfinite(first) or first != int(first):
        return None
    return Reading(values, int(first) & COUNTER)


def looks_like(data: bytes) -> str | None:
    """What bytes look like that no frame was found in; None where like nothing that is known."""
    for protocol in (E256, OscSlip, Csv, FlexiTac):
        if words := protocol.fits(data):
            return words
    return None
