"""OSC messages and bundles to send, built by python-osc; `core.osc` decodes those that arrive."""

from collections.abc import Sequence
from functools import lru_cache
from struct import Struct

from pythonosc.osc_bundle import OscBundle
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder

HEADS = 1024  # heads of messages that are remembered; a sensor has one or two
FROM_1900_S = 2_208_988_800  # s from 1900, where time tags begin, to 1970; their unit is 2**-32 s

_size, _tag = Struct(">i").pack, Struct(">Q").pack


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


def dated(moment: float | None, *elements: bytes) -> bytes:
    """A bundle with the time tag `moment`, in seconds since the Unix epoch, or with "immediately" for None.

    The elements are taken as they are. python-osc would parse them, which takes longer than all else for a frame, and
    would raise an error for the nonsense of a faulty sensor on a tape.
    """
    # In 2036 the count begins anew.
    since_1900 = 1 if moment is None else (round(moment * 2**32) + (FROM_1900_S << 32)) % 2**64
    return b"".join((b"#bundle\0", _tag(since_1900), *(part for one in elements for part in (_size(len(one)), one))))


@lru_cache(HEADS)
def head(address: str, types: str) -> bytes:
    """A message up to its arguments, which are `i` and `f` alone.

    python-osc takes a frame's numbers one by one, which is slow; they are packed behind this head instead.
    """
    built: bytes = message(address, types, [0] * len(types)).dgram
    return built[: len(built) - 4 * len(types)]
