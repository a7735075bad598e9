"""The OSC messages that were seen; their memory is bounded, since anybody may have sent them."""

import re
from collections import Counter
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from gestured.core import osc
from gestured.core.errors import ProtocolError
from gestured.core.osc import Message

MOST_ADDRESSES = 256  # the most pairs of address and types; messages of further ones are counted together
LEAST_TAXELS = 4  # 2 x 2
KEPT_BYTES = 64 << 20  # the most bytes of frames that are kept, for a proposal
ARRAY = re.compile(rb"\0,[a-z]*\[")  # type tags of an OSC array


@dataclass
class Seen:
    """The messages that came to one address with one list of types."""

    address: str
    types: str
    count: int = 0
    first: float = 0.0  # s
    last: float = 0.0
    sources: Counter[str] = field(default_factory=Counter)  # messages by sender, of the first four
    frames: list[tuple[float, NDArray[np.generic] | bytes]] = field(default_factory=list)  # (s, what may be a frame)
    integer: int | None = None  # the first integer of the last message
    steps: int = 0  # how often that integer grew by one from message to message

    @property
    def rate_hz(self) -> float:
        """Messages a second; 0 for a single message."""
        return (self.count - 1) / (self.last - self.first) if self.last > self.first else 0.0

    @property
    def contested(self) -> bool:
        """Whether several programs send as this sensor. One may open a new port for each message (see `Owner`)."""
        hosts = {source.rpartition(":")[0] for source in self.sources}
        return len(hosts) > 1 or len(self.sources) > 1 < max(self.sources.values())

    @property
    def counted(self) -> bool:
        """Whether the first of a message's integers counts the frames."""
        return self.types.startswith("i*") and self.count > 1 and self.steps >= (self.count - 1) / 2

    def taxels(self) -> tuple[int, ...]:
        """How many taxels a message may hold, the likeliest number first; () if it is no frame."""
        if match := re.fullmatch(r"(?:i )?b\[(\d+)\]", self.types):  # of uint16, float32 or uint8
            size = int(match[1])
            return tuple(size // n for n in (2, 4, 1) if size % n == 0 and size // n >= LEAST_TAXELS)
        if match := re.fullmatch(r"(?:i )?[fi]\*(\d+)", self.types):
            size = int(match[1])
            if self.types.startswith("i*"):
                found = (size - 1,) if self.counted else (size,) if self.count > 1 else (size, size - 1)
            else:
                found = (size,)
            return tuple(n for n in found if n >= LEAST_TAXELS)
        return ()

    def matrices(self, rows: int, columns: int) -> list[tuple[float, NDArray[np.float64]]]:
        """(s, (R, C) counts) of each kept frame of that size."""
        size = rows * columns
        found = []
        for t, what in self.frames:
            if isinstance(what, bytes):
                kind = {size: ">u1", 2 * size: ">u2", 4 * size: ">f4"}.get(len(what))
                what = np.frombuffer(what, kind) if kind else np.empty(0)
            if what.size >= size and np.isfinite(what[-size:].astype(np.float64)).all():
                found.append((t, what[-size:].astype(np.float64).reshape(rows, columns)))
        return found


class Sight:
    """All messages that were seen, by address and types, and the packets that could not be decoded."""

    def __init__(self) -> None:
        self.packets = 0
        self.seen: dict[tuple[str, str], Seen] = {}
        self.errors: Counter[str] = Counter()
        self.arrays = 0  # packets with an OSC array
        self._kept = 0  # bytes of frames

    def rows(self) -> list[Seen]:
        """Each pair of address and types, the most frequent first."""
        return sorted(self.seen.values(), key=lambda seen: -seen.count)

    def packet(self, t: float, source: str, packet: bytes) -> None:
        """Take one packet, read at `t` s."""
        self.packets += 1
        errors: list[ProtocolError] = []
        try:
            messages = osc.decode(packet, errors)
        except ProtocolError as error:
            messages, errors = [], [error]
        self.errors.update(error.reason for error in errors)
        self.arrays += bool(errors) and ARRAY.search(packet[: osc.MAX_ADDRESS + osc.MAX_TAGS]) is not None
        for message in messages:
            key = message.address, short_types(message)
            if key not in self.seen and len(self.seen) >= MOST_ADDRESSES:
                key = "(others)", ""
            seen = self.seen.setdefault(key, Seen(*key, first=t))
            seen.count += 1
            seen.last = t
            if source in seen.sources or len(seen.sources) < 4:
                seen.sources[source] += 1
            if key[1] and message.args and isinstance(message.args[-1], np.ndarray | bytes):
                self._keep(seen, t, message.args[-1])

    def _keep(self, seen: Seen, t: float, what: NDArray[np.generic] | bytes) -> None:
        if isinstance(what, np.ndarray) and what.dtype.kind == "i":
            first = int(what[0])
            seen.steps += seen.integer is not None and first - seen.integer in (1, 1 - 2**32)
            seen.integer = first
        size = len(what) if isinstance(what, bytes) else what.nbytes
        if self._kept + size <= KEPT_BYTES:
            self._kept += size
            seen.frames.append((t, what))


def short_types(message: Message) -> str:
    """A message's type tags, with the length of runs as in `i f*81`, and the size of blobs as in `b[162]`."""
    words = []
    sizes = iter([len(a) for a in message.args if isinstance(a, bytes)])
    for tag, run_of in groupby(message.types):
        count = len(list(run_of))
        if tag == "b":
            words += [f"b[{next(sizes)}]" for _ in range(count)]
        else:
            words.append(tag if count == 1 else f"{tag}*{count}")
    return " ".join(words)
