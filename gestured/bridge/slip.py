"""OSC packets on a serial line, framed by SLIP (RFC 1055): the protocols osc-slip and e256."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.bridge.readings import FEWEST, Protocol, Reading, reading_of
from gestured.core.errors import ProtocolError
from gestured.core.osc import Message, decode

SLIP_END = b"\xc0"
# By bytes a taxel: the type of a blob's numbers.
BLOB_TYPES: dict[int, np.dtype[Any]] = {1: np.dtype("u1"), 2: np.dtype(">u2"), 4: np.dtype(">f4")}


class OscSlip(Protocol):
    """OSC packets between END bytes."""

    def push(self, data: bytes) -> list[Reading]:
        """The first frame of each packet that holds any."""
        found = []
        for packet in self._ended(data, SLIP_END):
            reading = self._frame(slip_decoded(packet))
            if reading is None:
                self.passed += len(packet)
            else:
                found.append(reading)
        return found

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
        if values is None or values.size < self.taxels:  # numbers of another type in front are a counter, never taxels
            return None
        return reading_of([*before, *values.tolist()], self.shape, values.dtype)

    @staticmethod
    def fits(data: bytes) -> str | None:
        """Words if the bytes are several OSC packets, else None."""
        packets = [message for each in data.split(SLIP_END)[1:-1] for message in messages_of(slip_decoded(each))]
        if len(packets) < FEWEST:
            return None
        address, types, args, *_ = packets[0]
        size = sum(len(arg) if isinstance(arg, bytes | np.ndarray) else 1 for arg in args)
        return f"osc-slip with messages to {address} of {size} numbers or bytes, type tags {types[:4]}"


class E256(OscSlip):
    """The e256: for each frame the bridge sends the OSC message `/r`, and gets one with a blob of counts."""

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
        """Words if the bytes are several answers of an e256, else None."""
        return "e256" if len(E256(*E256.grid).push(data)) >= FEWEST else None


def slip_decoded(packet: bytes) -> bytes:
    """A packet without its escapes."""
    return packet.replace(b"\xdb\xdc", b"\xc0").replace(b"\xdb\xdd", b"\xdb")


def messages_of(packet: bytes) -> list[Message]:
    """The OSC messages of a packet; none if it is not OSC."""
    try:
        return decode(packet)
    except ProtocolError:
        return []
