"""OSC that goes out, built by python-osc; what comes in is decoded by `core.osc`."""

from collections.abc import Sequence
from functools import lru_cache
from struct import Struct
from typing import Any

import numpy as np
from pythonosc.osc_bundle import OscBundle
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder

HEADS = 1024  # heads of messages that are remembered; a sensor has one or two
ANEW_S = 2_085_978_496  # s since 1970, in 2036, when a time tag's 32 bits of seconds begin anew
AGAIN_S = 2**32  # from one beginning of a time tag's seconds to the next
NOT_ZERO_S = 2.0**-32  # in place of 0: so little that the time tag is that of 1970 all the same

_size = Struct(">i").pack


def message(address: str, types: str, args: Sequence[int | float | str | bytes]) -> OscMessage:
    """One message; `types` has a type tag for each argument: i f d h s b. Raises ValueError, BuildError."""
    builder = OscMessageBuilder(address)
    for tag, arg in zip(types, args, strict=True):
        builder.add_arg(arg, tag)
    return builder.build()


def bundle(*messages: OscMessage) -> OscBundle:
    """A bundle of messages with the time tag "immediately"."""
    builder = OscBundleBuilder(IMMEDIATELY)
    for content in messages:
        builder.add_content(content)
    return builder.build()


def dated(moment: float, *elements: bytes) -> bytes:
    """A bundle with the time tag `moment`, in seconds since the Unix epoch.

    The elements are taken as they are: python-osc parses what a bundle is given, which would take longer than all else
    for a frame, and raise for what a tape has of a sensor that sends nonsense.
    """
    # A float64 holds a time since 1900 to half a microsecond only, a longdouble to the time tag's own resolution.
    since_1970 = (np.longdouble(moment) - ANEW_S) % AGAIN_S + (ANEW_S - AGAIN_S)
    seconds: Any = since_1970 or NOT_ZERO_S  # python-osc takes 0 for "immediately"
    empty = OscBundleBuilder(seconds).build().dgram
    return b"".join((empty, *(part for element in elements for part in (_size(len(element)), element))))


@lru_cache(HEADS)
def head(address: str, types: str) -> bytes:
    """A message up to its arguments, which are `i` and `f` alone.

    python-osc takes a frame's numbers one by one, which is slow; they are packed behind this head instead.
    """
    built: bytes = message(address, types, [0] * len(types)).dgram
    return built[: len(built) - 4 * len(types)]
