"""Tapes: packets as a daemon received them and the events that it made of them, in an MCAP file (mcap.dev).

`/gestured/packets` holds each datagram as it came (message encoding `osc`; one channel for each sender, its address in
the channel's metadata), `/gestured/events` the lines of the event stream (JSON, with a schema). The log time is when
the daemon read the packet, in ns since the Unix epoch; packets of one read have one time. The metadata record `scene`
has the model and the settings. So a tape replays through the same code to the same events.

A tape is written once, never changed, and is good up to its last whole chunk, wherever writing was cut off.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gestured.core.address import Address

PACKETS, EVENTS, SCENE = "/gestured/packets", "/gestured/events", "scene"
# The JSON schema of a line of the event stream, which may have more keys.
EVENT_SCHEMA: dict[str, Any] = {
    "title": "gestured.Event",
    "type": "object",
    "properties": {
        **dict.fromkeys(("type", "sensor", "gesture", "model", "reason"), {"type": "string"}),
        **dict.fromkeys(("confidence", "onset", "offset", "decided", "since"), {"type": "number"}),
        "id": {"type": "integer"},
        "closed": {"type": "array", "items": {"type": "string"}},
        "until": {"type": ["number", "null"]},
    },
    "required": ["type"],
}


@dataclass(frozen=True, slots=True)
class Packet:
    """A datagram as it was recorded."""

    t_ns: int  # when the daemon read it, since the Unix epoch
    source: Address
    data: bytes


@dataclass(frozen=True, slots=True)
class Tape:
    """The content of a file, in the order of writing. `whole` is false if writing was cut off.

    `told` has the number of packets before each event.
    """

    scene: Mapping[str, Any]
    packets: tuple[Packet, ...]
    events: tuple[Mapping[str, Any], ...]
    whole: bool
    told: tuple[int, ...] = ()
