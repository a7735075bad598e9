"""The protocols of sensors on serial lines: bytes in, frames out. Pure: no device, no clock.

flexitac   AA 55, then rows x columns bytes, row by row, one byte a taxel; 2,000,000 baud, about 100 frames a second
           (WT-MM/PyFlexiTac: flexitac/protocol.py and firmware/profiles.py; CL-YQLM/flexitac-live: README.md).
e256       eTextile's 16 x 16 matrix: asked by the OSC message /r, it answers with /r and one blob of 256 bytes, both
           framed by SLIP; 230,400 baud (eTextile/Matrix: Firmware/main/transmit_osc.cpp and config.h).
osc-slip   OSC packets framed by SLIP (RFC 1055); the first message that holds a frame counts, whatever its address.
csv        a line of numbers for each frame, with commas, semicolons, tabs or spaces between them.

In osc-slip and csv one more leading number is the sensor's own frame counter.
"""

from collections import Counter

import numpy as np

from gestured.bridge.readings import FEWEST, MOST_TAXELS, Protocol, Reading, reading_of
from gestured.bridge.slip import E256, OscSlip

MOST_LINES = 0.75  # share of the lines that must have equally many numbers, since some may be damaged
TRIED = 64  # so many markers are tried as the first of a frame, each with as many as that of the next frame


class FlexiTac(Protocol):
    """Frames that begin with a marker. The marker may also occur in the data, so the next frame's must follow, too."""

    baud = 2_000_000
    grid = (16, 16)
    MARKER = b"\xaa\x55"

    def push(self, data: bytes) -> list[Reading]:
        """The frames after which the marker of the next one stands; a frame that lost a byte is dropped."""
        self._buffer += data
        found = []
        size = len(self.MARKER) + self.taxels
        while len(self._buffer) >= size + len(self.MARKER):
            if self._buffer.startswith(self.MARKER) and self._buffer.startswith(self.MARKER, size):
                found.append(self._take(size))
            else:
                at = self._buffer.find(self.MARKER, 1)  # after the first byte; the last may be half a marker
                self._pass(at if at > 0 else len(self._buffer) - self._buffer.endswith(self.MARKER[:1]))
        return found

    def flush(self) -> list[Reading]:
        """The frame in the buffer if nothing follows it, since the line is quiet for some ms between two frames."""
        size = len(self.MARKER) + self.taxels
        if len(self._buffer) == size and self._buffer.startswith(self.MARKER):
            return [self._take(size)]
        return []

    def _take(self, size: int) -> Reading:
        values = np.frombuffer(bytes(self._buffer[len(self.MARKER) : size]), np.uint8).reshape(self.shape)
        del self._buffer[:size]
        return Reading(values)

    @staticmethod
    def fits(data: bytes) -> str | None:
        """Words if the bytes have markers at even distances, else None."""
        places = [n for n in range(len(data) - 1) if data.startswith(FlexiTac.MARKER, n)]
        here = set(places)
        for at in places[:TRIED]:
            for after in places[:TRIED]:
                distance = after - at
                taxels = distance - len(FlexiTac.MARKER)
                if 4 <= taxels <= MOST_TAXELS and all(at + k * distance in here for k in range(FEWEST + 1)):
                    return f"flexitac with frames of {taxels} taxels"
        return None


class Csv(Protocol):
    """Frames that are lines of numbers."""

    _begun = False  # whether the first line, which may be incomplete, is over
    _counted: bool | None = None  # whether the sensor's lines begin with a counter; None before the first
    _others = 0  # number of lines in a row that are not as `_counted` says

    def push(self, data: bytes) -> list[Reading]:
        """The frame of each line that holds one."""
        found = []
        for line in self._ended(data, b"\n"):
            reading = reading_of(numbers(line), self.shape, np.dtype(float)) if self._begun else None
            self._begun = True
            if reading is not None and self._sound(reading):
                found.append(reading)
            elif line.strip():
                self.passed += len(line)
        return found

    def _sound(self, reading: Reading) -> bool:
        """Whether a line has a counter if those before it had, since a damaged separator adds or removes a number.

        After FEWEST lines in a row that differ, the sensor counts as changed.
        """
        counted = reading.counter is not None
        self._others = 0 if self._counted in (None, counted) else self._others + 1
        if self._others in (0, FEWEST):
            self._counted, self._others = counted, 0
        return self._counted == counted

    @staticmethod
    def fits(data: bytes) -> str | None:
        """Words if the bytes are lines of equally many numbers, but for a few damaged ones, else None."""
        lines = data.split(b"\n")[1:-1]
        ((count, often),) = Counter(len(numbers(line)) for line in lines).most_common(1) or [(0, 0)]
        if count >= 4 and often >= FEWEST and often >= MOST_LINES * len(lines):
            return f"csv with {count} numbers a line (a line is a frame)"
        return None


# In the order in which `looks_like` tries them: E256 before OscSlip, of which it is a special case; last the one that
# noise resembles most.
PROTOCOLS: dict[str, type[Protocol]] = {"e256": E256, "osc-slip": OscSlip, "csv": Csv, "flexitac": FlexiTac}


def numbers(line: bytes) -> list[float]:
    """The numbers in a line of text; none if the line has anything else."""
    for separator in (b",", b";", b"\t"):
        line = line.replace(separator, b" ")
    try:
        return [float(word) for word in line.split()]
    except ValueError:
        return []


def looks_like(data: bytes) -> str | None:
    """The protocol that bytes without a frame look like, in words; None if they look like none."""
    for protocol in PROTOCOLS.values():
        if words := protocol.fits(data):
            return words
    return None
