"""A parser of OSC 1.0 (opensoundcontrol.org/spec-1_0): bounded, not recursive, with one type of error.

Whatever the bytes are, `decode` gives messages or raises `ProtocolError`, in time linear in their number.
A sensor sends the same layout over and over, so a packet with a known layout is not parsed again: its values are
read from their known places. Type tags known: `i f d h t s b`.

Reasons: `not_osc` (no message, no bundle), `address` (not ASCII, too long), `types` (type tags missing or not
known, a string that is not UTF-8), `truncated` (fewer bytes than the type tags need), `trailing` (more),
`bundle` (sizes that do not fit, nested too deep), `oversized` (packet, type tags or number of messages).
"""

from collections.abc import Callable, Iterable
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import ProtocolError

Argument = int | float | str | bytes | NDArray[np.generic]

MAX_PACKET = 65_536  # bytes; no UDP datagram is longer
MAX_ADDRESS = 255  # bytes of an address
MAX_TAGS = 4_352  # type tags of one message; a 64 x 64 frame has 4,097
MAX_MESSAGES = 2_048  # messages of one packet
MAX_DEPTH = 8  # bundles within bundles
RUN = 4  # so many `i` or `f` in a row, or more, become one array

_BUNDLE = b"#bundle\0"
_SCALARS = {"i": "i", "f": "f", "d": "d", "h": "q", "t": "Q"}
_ARRAYS = {"i": np.dtype(">i4"), "f": np.dtype(">f4")}
_RUNS = tuple(tag * RUN for tag in _ARRAYS)
# Kinds of arguments that a `Slot` can describe: s, scalars; r, a run of numbers; b, a blob that is not empty.
_SLOTTED = ("", "s", "r", "sr", "b", "sb")
LAYOUTS_BYTES = 8 << 20  # memory for the layouts that are remembered: 8,000 sensors of 9 x 9 floats
SLOT_BYTES = 600  # memory that Python takes for a slot, without its head, address, type tags and scalars
SCALAR_BYTES = 48  # memory that Python takes for a scalar in a slot
# The bytes at which a packet's first head begins (in a bundle, its message's size), enough for all of a short head.
ALONE, BUNDLED = slice(32), slice(16, 48)

_TIMETAG = Struct(">II").unpack_from  # seconds and their fraction
_NTP_EPOCH = 2_208_988_800  # s, 1970 counted from 1900; the count begins anew in 2036, so we tell 1970 to 2106


class Message(NamedTuple):
    """One OSC message.

    `args` holds int, float, str and bytes; but four or more `i` or `f` in a row are ONE big-endian, read-only
    array, so `,iffff` has two arguments. `timetag` is that of the innermost bundle in seconds since the Unix
    epoch, None without one or for "immediately". Messages with the same `bundle` stand in the same bundle.
    """

    address: str
    types: str  # without the comma
    args: tuple[Argument, ...]
    timetag: float | None = None
    bundle: int = -1  # the bundle's number in the packet; -1 is none


def timetag(data: bytes, at: int, end: int) -> float | None:
    """The time tag at byte `at` of a bundle that ends at `end`: s since the Unix epoch, None for "immediately".

    Raises ProtocolError if the bundle has no room for it.
    """
    if end - at < 8:
        raise ProtocolError("bundle", "a bundle without its time tag")
    seconds, fraction = _TIMETAG(data, at)
    if seconds == 0 and fraction == 1:  # "immediately"
        return None
    return float((seconds - _NTP_EPOCH) % 2**32 + fraction * 2**-32)


def timetags(rows: NDArray[np.uint8]) -> NDArray[np.float64]:
    """What `timetag` gives of each of (n, 8) bytes, (n,) s; NaN for "immediately"."""
    tags = rows.view(">u8")[:, 0].astype(np.uint64)  # in units of 2**-32 s; they wrap by themselves
    return np.where(tags == 1, np.nan, (tags - (_NTP_EPOCH << 32)) * 2.0**-32)


class Slot(NamedTuple):
    """Where one message stands in a packet of a known layout: scalars, then a run of numbers or a blob, or none."""

    start: int  # byte at which the head begins
    head: bytes  # address and type tags, padded; in a bundle with the message's size before them
    address: str
    types: str
    unpack: Callable[[bytes, int], tuple[Any, ...]] | None  # reads the scalars
    scalars: int  # byte at which the scalars begin
    dtype: Any  # of the run; None for a blob
    length: int  # values of the run, or bytes of the blob; 0 for none
    run: int  # byte at which the run or the blob begins

    @property
    def blob(self) -> bool:
        """Whether a blob stands there, which says its own size."""
        return self.dtype is None and self.length > 0


class Layout:
    """How a packet is laid out: its length in bytes, and its messages."""

    __slots__ = ("length", "meaning", "slots")

    def __init__(self, length: int, slots: list[Slot]) -> None:
        self.length, self.slots = length, slots
        self.meaning: Any = None  # what `wire.Decoder` has found out about such packets; None before it looked


_new = tuple.__new__  # Message(...) takes twice the time
_frombuffer = np.frombuffer


class Layouts:
    """The layouts that are known. Hostile senders invent new ones, so all are forgotten when their memory is used."""

    def __init__(self, most_bytes: int = LAYOUTS_BYTES) -> None:
        self._most_bytes = self._room = most_bytes
        self._known: dict[bytes, Layout] = {}  # by `_key`

    def __len__(self) -> int:
        """How many layouts are known."""
        return len(self._known)

    def find(self, data: bytes) -> Layout | None:
        """The layout of a packet, None if it is not known. The size that a blob gives is not compared."""
        begin = data[BUNDLED if data.startswith(_BUNDLE) else ALONE]
        layout = self._known.get(begin) or self._known.get(_key(begin))
        if layout is None or layout.length != len(data):
            return None
        for slot in layout.slots:
            if not data.startswith(slot[1], slot[0]):
                return None
        return layout

    def guess(self, packets: Iterable[bytes]) -> list[Layout | None]:
        """The layout that each packet may have, or None; the caller has to compare its length and heads."""
        known = self._known.get
        begins = [data[BUNDLED if data.startswith(_BUNDLE) else ALONE] for data in packets]
        return [known(begin) or known(_key(begin)) for begin in begins]

    def read(self, data: bytes, bundled: bool) -> list[Message] | None:
        """The messages of a packet, None if its layout is not known."""
        layout = self.find(data)
        if layout is None:
            return None
        time, bundle = (timetag(data, 8, len(data)), 0) if bundled else (None, -1)
        messages: list[Message] = []
        for _, _, address, types, unpack, scalars, dtype, length, run in layout.slots:
            args: tuple[Argument, ...] = () if unpack is None else unpack(data, scalars)
            if dtype is not None:
                args += (_frombuffer(data, dtype, length, run),)
            elif length:
                if int.from_bytes(data[run - 4 : run], "big") != length:
                    return None
                args += (data[run : run + length],)
            messages.append(_new(Message, (address, types, args, time, bundle)))
        return messages

    def remember(self, data: bytes, slots: list[Slot], bundled: bool) -> None:
        """Remember the layout of a packet: messages in these slots, and nothing else."""
        cost = 0
        for slot in slots:
            rest = slot.length if slot.dtype is not None else slot.length > 0  # tags that are no scalar's
            cost += SLOT_BYTES + 3 * len(slot.head) + SCALAR_BYTES * (len(slot.types) - rest)
        if cost > self._room:
            self._known.clear()
            self._room = self._most_bytes
        self._room -= cost
        self._known[_key(data[BUNDLED if bundled else ALONE])] = Layout(len(data), slots)


def _key(begin: bytes) -> bytes:
    """The key of a layout: the first address and type tags, without the values after them, which change.

    If `begin` ends within the type tags, as in a frame of floats, the whole of `begin` is the key.
    """
    end = begin.find(b"\0", begin.find(b","))
    return begin if end < 0 else begin[:end]


def decode(data: bytes, errors: list[ProtocolError] | None = None, layouts: Layouts | None = None) -> list[Message]:
    """All messages of a packet, bundles flattened, in order.

    Raises ProtocolError at the first fault; with `errors` it adds the faults to that list instead and keeps every
    sound message. `layouts` remembers how packets are laid out, so that the next ones cost less.
    """
    if type(data) is not bytes:
        data = bytes(data)  # the arrays are views of these bytes, which must not change
    bundled = data[:8] == _BUNDLE
    if layouts is not None and (known := layouts.read(data, bundled)) is not None:
        return known
    messages: list[Message] = []
    slots: list[Slot] = []
    try:
        if len(data) > MAX_PACKET:
            raise ProtocolError("oversized", f"{len(data)} bytes, at most {MAX_PACKET}")
        if bundled:
            _bundle(data, messages, slots, errors)
        else:
            messages.append(_message(data, 0, 0, len(data), None, -1, slots))
    except ProtocolError as error:
        if errors is None:
            raise
        errors.append(error)
    if layouts is not None and 0 < len(slots) == len(messages) and not errors:  # messages with strings have no slot
        layouts.remember(data, slots, bundled)
    return messages


def _bundle(data: bytes, messages: list[Message], slots: list[Slot], errors: list[ProtocolError] | None) -> None:
    end = len(data)
    time = timetag(data, 8, end)
    number = bundles = seen = 0
    outer: list[tuple[int, float | None, int]] = []  # end, time tag and number of the bundles around this one
    at = 16
    while True:
        if at == end:  # an inner bundle ends where its sibling begins
            if not outer:
                return
            end, time, number = outer.pop()
            continue
        size = int.from_bytes(data[at : at + 4], "big", signed=True)
        at += 4
        if size <= 0 or size % 4 or at + size > end:
            raise ProtocolError("bundle", f"an element of {size} bytes where {end - at} are left")
        if data.startswith(_BUNDLE, at):
            if len(outer) == MAX_DEPTH - 1:
                raise ProtocolError("bundle", f"nested deeper than {MAX_DEPTH}")
            outer.append((end, time, number))
            bundles += 1
            end, time, number = at + size, timetag(data, at + 8, at + size), bundles
            slots.clear()
            slots = []  # so the layout of a packet with inner bundles is not remembered
            at += 16
            continue
        seen += 1
        if seen > MAX_MESSAGES:
            raise ProtocolError("oversized", f"more than {MAX_MESSAGES} messages")
        try:
            messages.append(_message(data, at - 4, at, at + size, time, number, slots))
        except ProtocolError as error:
            if errors is None:
                raise
            errors.append(error)
        at += size


def _message(
    data: bytes, begin: int, start: int, end: int, time: float | None, bundle: int, slots: list[Slot]
) -> Message:
    """The message at `start`; its size, if it has one, is at `begin`. Raises ProtocolError.

    If its arguments are of a kind in `_SLOTTED`, its slot is added to `slots`.
    """
    address, types, at = _head(data, start, end)
    head = data[begin:at]
    args: tuple[Argument, ...] = ()
    kinds = ""
    scalars, run, dtype, count = at, at, None, 0
    i = 0
    while i < len(types):
        tag = types[i]
        stop = i + 1
        if tag in _ARRAYS:
            while stop < len(types) and types[stop] == tag:
                stop += 1
        if stop - i >= RUN:
            kinds += "r"
            dtype, count, run = _ARRAYS[tag], stop - i, at
            at = _after(at, 4 * count, end)
            args += (np.frombuffer(data, dtype, count, run),)
        elif tag in _SCALARS:
            while stop < len(types) and types[stop] in _SCALARS and types[stop : stop + RUN] not in _RUNS:
                stop += 1
            kinds += "s"
            layout = Struct(">" + "".join(_SCALARS[t] for t in types[i:stop]))
            scalars, at = at, _after(at, layout.size, end)
            args += layout.unpack_from(data, scalars)
        else:
            run = at + 4
            value, at = _sized(data, tag, at, end)
            count = len(value)
            kinds += "b" if tag == "b" and count else "?"
            args += (value,)
        i = stop
    if at != end:
        raise ProtocolError("trailing", f"{end - at} bytes more than the type tags say")
    if kinds in _SLOTTED:
        unpack = layout.unpack_from if "s" in kinds else None
        slots.append(Slot(begin, head, address, types, unpack, scalars, dtype, count, run))
    return Message(address, types, args, time, bundle)


def _head(data: bytes, start: int, end: int) -> tuple[str, str, int]:
    """Address, type tags, and where the arguments begin. Raises ProtocolError."""
    if not data.startswith(b"/", start):
        raise ProtocolError("not_osc", "neither an OSC message nor a bundle")
    comma = data.find(b",", start, end)  # no address holds a comma, so this one begins the type tags
    name_end = data.find(b"\0", start, comma) if comma >= 0 else -1
    if name_end < 0 or name_end + 4 - (name_end - start) % 4 != comma:
        raise ProtocolError("types", "no type tags after the address")
    address = data[start:name_end]
    if len(address) > MAX_ADDRESS or not address.isascii():
        raise ProtocolError("address", f"not ASCII, or longer than {MAX_ADDRESS} bytes")
    stop = data.find(b"\0", comma, end)
    at = stop + 4 - (stop - start) % 4
    if stop < 0 or at > end:
        raise ProtocolError("truncated", "type tags without an end")
    if stop - comma > MAX_TAGS:
        raise ProtocolError("oversized", f"{stop - comma - 1} type tags, fewer than {MAX_TAGS} expected")
    return address.decode("ascii"), data[comma + 1 : stop].decode("latin-1"), at


def _after(at: int, size: int, end: int) -> int:
    if size > end - at:
        raise ProtocolError("truncated", "fewer arguments than type tags")
    return at + size


def _sized(data: bytes, tag: str, at: int, end: int) -> tuple[bytes | str, int]:
    """A blob or a string, and where the next argument begins. Raises ProtocolError."""
    if tag == "b":
        at = _after(at, 4, end)
        size = int.from_bytes(data[at - 4 : at], "big", signed=True)
        if size < 0:
            raise ProtocolError("truncated", f"a blob of {size} bytes")
        return data[at : at + size], _after(at, size + -size % 4, end)
    if tag != "s":
        raise ProtocolError("types", f"type tag {tag!r} is none of i f d h t s b")
    stop = data.find(b"\0", at, end)
    if stop < 0:
        raise ProtocolError("truncated", "a string without an end")
    try:
        return data[at:stop].decode(), _after(stop, 4 - (stop - at) % 4, end)
    except UnicodeDecodeError:
        raise ProtocolError("types", "a string that is not UTF-8") from None
