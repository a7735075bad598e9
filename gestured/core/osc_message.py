"""One OSC message, and the time tag of the bundle that it stands in."""

from struct import Struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import ProtocolError

Argument = int | float | str | bytes | NDArray[np.generic]

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

    Raises ProtocolError where the bundle has no room for it.
    """
    if end - at < 8:
        raise ProtocolError("bundle", "a bundle without its time tag")
    seconds, fraction = _TIMETAG(data, at)
    if seconds == 0 and fraction == 1:  # "immediately"
        return None
    return float((seconds - _NTP_EPOCH) % 2**32 + fraction * 2**-32)
