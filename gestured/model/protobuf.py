"""The protobuf wire format, in which an .onnx file is written: a message's fields, found without trusting a length.

Functions here raise ValueError where the bytes are no such message.
"""

from collections.abc import Iterator

Field = tuple[int, int, int, int]  # its number, wire type, and the span of its payload; a varint's value comes first

VARINT, BYTES = 0, 2  # wire types: a whole number; bytes, a text or a message, with their length before them
FIXED_BYTES = {1: 8, 5: 4}  # the other two that are in use: so many bytes
DAMAGED = "is not an ONNX model, or is truncated or damaged"


def fields(data: bytes, at: int, end: int) -> Iterator[Field]:
    """The fields of the message that lies in `data` from `at` to `end`."""
    while at < end:
        tag, at = varint(data, at, end)
        number, wire = tag >> 3, tag & 7
        if wire == VARINT:
            value, at = varint(data, at, end)
            yield number, wire, value, at
            continue
        if wire == BYTES:
            length, at = varint(data, at, end)
        else:
            length = FIXED_BYTES.get(wire, -1)
        if number == 0 or length < 0 or length > end - at:
            raise ValueError(DAMAGED)
        yield number, wire, at, at + length
        at += length


def varint(data: bytes, at: int, end: int) -> tuple[int, int]:
    """(the whole number that begins at `at`, where it ends): seven bits a byte, the lowest first."""
    if at < end and data[at] < 0x80:  # most are a single byte
        return data[at], at + 1
    value = 0
    for shift in range(0, 70, 7):  # at most ten bytes, which hold 64 bits
        if at >= end:
            break
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise ValueError(DAMAGED)
