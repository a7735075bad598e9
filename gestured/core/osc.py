"""Bytes -> OSC 1.0 (opensoundcontrol.org/spec-1_0): bounded, non-recursive, one error type.

Whatever the bytes are, `decode` gives messages or raises `ProtocolError`, in time linear in their number.
A sensor sends the same layout over and over: a packet that is laid out as one before is not parsed again, its
values are read from where they must be. Type tags known: `i f d h t s b`.

Reasons: `not_osc` (no message, no bundle), `address` (not ASCII, too long), `types` (type tags missing or not
known, a string that is not UTF-8), `truncated` (fewer bytes than the type tags need), `trailing` (more),
`bundle` (sizes that do not fit, nested too deep), `oversized` (packet, type tags or number of messages).
"""

from struct import Struct

import numpy as np

from gestured.core.errors import ProtocolError
from gestured.core.layouts import Layouts, Place
from gestured.core.osc_message import Argument, Message, timetag

MAX_PACKET = 65_536  # bytes; no UDP datagram is longer
MAX_ADDRESS = 255  # bytes of an address
MAX_TAGS = 4_352  # type tags of one message; a 64 x 64 frame has 4,097
MAX_MESSAGES = 2_048  # messages of one packet
MAX_DEPTH = 8  # bundles within bundles
RUN = 4  # `i` or `f` in a row from which on they come as one array

_BUNDLE = b"#bundle\0"
_SCALARS = {"i": "i", "f": "f", "d": "d", "h": "q", "t": "Q"}
_ARRAYS = {"i": np.dtype(">i4"), "f": np.dtype(">f4")}
_RUNS = tuple(tag * RUN for tag in _ARRAYS)
_PLACED = ("", "s", "r", "sr", "b", "sb")  # what has a place in a layout: scalars, a run, a blob that is not empty


def decode(data: bytes, errors: list[ProtocolError] | None = None, layouts: Layouts | None = None) -> list[Message]:
    """All messages of a packet, bundles flattened, in order.

    Raises ProtocolError at the first fault; where `errors` is given, puts faults there instead and keeps
    every message that is sound. `layouts` remembers how packets are laid out, so that the next ones cost less.
    """
    if type(data) is not bytes:
        data = bytes(data)  # arrays are views of it: it must not change under their reader
    bundled = data[:8] == _BUNDLE
    if layouts is not None and (known := layouts.read(data, bundled)) is not None:
        return known
    messages: list[Message] = []
    places: list[Place] = []
    try:
        if len(data) > MAX_PACKET:
            raise ProtocolError("oversized", f"{len(data)} bytes, at most {MAX_PACKET}")
        if bundled:
            _bundle(data, messages, places, errors)
        else:
            messages.append(_message(data, 0, 0, len(data), None, -1, places))
    except ProtocolError as error:
        if errors is None:
            raise
        errors.append(error)
    if layouts is not None and 0 < len(places) == len(messages) and not errors:  # no string is in it, no inner bundle
        layouts.remember(data, places, bundled)
    return messages


def _bundle(data: bytes, messages: list[Message], places: list[Place], errors: list[ProtocolError] | None) -> None:
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
            places.clear()
            places = []  # such a packet is read anew each time
            at += 16
            continue
        seen += 1
        if seen > MAX_MESSAGES:
            raise ProtocolError("oversized", f"more than {MAX_MESSAGES} messages")
        try:
            messages.append(_message(data, at - 4, at, at + size, time, number, places))
        except ProtocolError as error:
            if errors is None:
                raise
            errors.append(error)
        at += size


def _message(
    data: bytes, begin: int, start: int, end: int, time: float | None, bundle: int, places: list[Place]
) -> Message:
    """The message at `start`; its size, where it has one, is at `begin`. Raises ProtocolError.

    Where it has only scalars and a run or a blob after them, its place is added to `places`.
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
    if kinds in _PLACED:
        unpack = layout.unpack_from if "s" in kinds else None
        places.append(Place(begin, head, address, types, unpack, scalars, dtype, count, run))
    return Message(address, types, args, time, bundle)


def _head(data: bytes, start: int, end: int) -> tuple[str, str, int]:
    """Address, type tags, and where the arguments begin. Raises ProtocolError."""
    if not data.startswith(b"/", start):
        raise ProtocolError("not_osc", "neither an OSC message nor a bundle")
    comma = data.find(b",", start, end)  # no address holds one: it begins the type tags
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
