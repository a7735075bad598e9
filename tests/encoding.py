"""OSC packets for tests: any type tags, sound elements and others, arrays at once.

It shares nothing with python-osc nor with the package, so that both can be held against it.
"""

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

NTP_S = 2_208_988_800  # 1970, counted from 1900
ARRAYS = {"i": ">i4", "f": ">f4"}
SCALARS = {"i": ">i", "f": ">f", "d": ">d", "h": ">q", "t": ">Q"}


def message(address: str, types: str, args: Sequence[Any] = ()) -> bytes:
    """One message; an array stands for as many equal type tags as it is long."""
    parts, at = [_string(address), _string("," + types)], 0
    for arg in args:
        tag = types[at]
        if isinstance(arg, np.ndarray):
            parts.append(arg.astype(ARRAYS[tag]).tobytes())
        elif tag == "s":
            parts.append(_string(arg))
        elif tag == "b":
            parts.append(struct.pack(">i", len(arg)) + arg + bytes(-len(arg) % 4))
        else:
            parts.append(struct.pack(SCALARS[tag], arg))
        at += arg.size if isinstance(arg, np.ndarray) else 1
    return b"".join(parts)


def bundle(elements: Sequence[bytes], timetag: float | None = None) -> bytes:
    """A bundle; `timetag` in seconds since 1970, None is "immediately"."""
    raw = 1 if timetag is None else (round(timetag * 2**32) + (NTP_S << 32)) % 2**64
    sized = (part for element in elements for part in (struct.pack(">i", len(element)), element))
    return b"".join((b"#bundle\0", struct.pack(">Q", raw), *sized))


def _string(text: str) -> bytes:
    raw = text.encode()
    return raw + bytes(4 - len(raw) % 4)
