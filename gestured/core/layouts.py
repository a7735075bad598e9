"""How packets were laid out that came before: one that is laid out the same is read without parsing it again."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from gestured.core.osc_message import Argument, Message, timetag

LAYOUTS_BYTES = 8 << 20  # for the layouts that are remembered: 8,000 sensors of 9 x 9 floats
PLACE_BYTES = 600  # that Python takes for a place, its head, address, type tags and scalars not counted
SCALAR_BYTES = 48  # that Python takes for a scalar in a place
# The bytes of a packet in which its first head begins, or all of it is: in a bundle with the size before it.
ALONE, BUNDLED = slice(32), slice(16, 48)


class Place(NamedTuple):
    """Where a packet of a known layout has one message: scalars, then a run or a blob; all may be missing."""

    start: int  # byte
    head: bytes  # what stands there: address and type tags, padded; in a bundle the size before them
    address: str
    types: str
    unpack: Callable[[bytes, int], tuple[Any, ...]] | None  # reads the scalars
    scalars: int  # byte, where they are
    dtype: Any  # of the run; None for a blob
    length: int  # values of the run, or bytes of the blob; 0 for none
    run: int  # byte, where it is


_new = tuple.__new__  # Message(...) takes twice the time
_frombuffer = np.frombuffer


class Layouts:
    """The layouts that are known. They are bounded, because hostile senders invent new ones: when full, all go."""

    def __init__(self, most_bytes: int = LAYOUTS_BYTES) -> None:
        self._most_bytes = self._room = most_bytes
        self._known: dict[bytes, tuple[int, list[Place]]] = {}  # a packet's length in bytes, and its messages

    def __len__(self) -> int:
        """How many are known."""
        return len(self._known)

    def read(self, data: bytes, bundled: bool) -> list[Message] | None:
        """The messages of a packet, None where its layout is not known."""
        begin = data[BUNDLED if bundled else ALONE]
        layout = self._known.get(begin) or self._known.get(_key(begin))
        if layout is None or layout[0] != len(data):
            return None
        time, bundle = (timetag(data, 8, len(data)), 0) if bundled else (None, -1)
        messages: list[Message] = []
        for start, head, address, types, unpack, scalars, dtype, length, run in layout[1]:
            if not data.startswith(head, start):
                return None
            args: tuple[Argument, ...] = () if unpack is None else unpack(data, scalars)
            if dtype is not None:
                args += (_frombuffer(data, dtype, length, run),)
            elif length:
                if int.from_bytes(data[run - 4 : run], "big") != length:
                    return None
                args += (data[run : run + length],)
            messages.append(_new(Message, (address, types, args, time, bundle)))
        return messages

    def remember(self, data: bytes, places: list[Place], bundled: bool) -> None:
        """A packet has just these messages, in these places, and nothing else is in it."""
        cost = 0
        for place in places:
            rest = place.length if place.dtype is not None else place.length > 0  # type tags of the run, or the blob
            cost += PLACE_BYTES + 3 * len(place.head) + SCALAR_BYTES * (len(place.types) - rest)
        if cost > self._room:
            self._known.clear()
            self._room = self._most_bytes
        self._room -= cost
        self._known[_key(data[BUNDLED if bundled else ALONE])] = (len(data), places)


def _key(begin: bytes) -> bytes:
    """By what a layout is found: the first address and type tags. What follows them is different in each packet.

    It is all of `begin` where they do not end there, as those of a frame of floats, which is found without this.
    """
    end = begin.find(b"\0", begin.find(b","))
    return begin if end < 0 else begin[:end]
