"""The lines of the event socket, as JSON: what a client is told, and what it asks to hear.

An invalid request is a ProtocolError with the reason `subscription`.
"""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypedDict, Unpack, get_args

from gestured.core.address import is_sensor
from gestured.core.errors import ProtocolError
from gestured.core.events import Event, Gesture, Place, Provisional, Status, Touch, Unknown, Where

MAX_LINE = 16_384  # bytes of a client's request: room for 64 sensors, zones and gestures with the longest names
LONGEST = 60  # the most characters of what a peer sent that an answer quotes
EVENT_TYPES = tuple(cls.__name__.lower() for cls in get_args(Event))
STREAM_TIMES = frozenset(("onset", "offset", "decided", "until", "since", "t"))
# By type and field: the value with which a line leaves the field out.
_UNSAID: dict[tuple[str, str], object] = {
    ("gesture", "own"): False, ("gesture", "where"): None, ("unknown", "where"): None, ("unknown", "gates"): (),
    ("touch", "reason"): None,
}  # fmt: skip
# By type, for each field: its name, whether it is a time, and the value with which it is left out.
_FIELDS = {
    kind: tuple((one.name, one.name in STREAM_TIMES, _UNSAID.get((kind, one.name), ...)) for one in fields(cls))
    for kind, cls in zip(EVENT_TYPES, get_args(Event), strict=True)
}


def json_object(text: str | bytes) -> dict[str, Any] | None:
    """The JSON object in somebody else's text, bytes as UTF-8; None for anything else, or if it is nested too deep."""
    try:
        found = json.loads(text.decode() if isinstance(text, bytes) else text)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def event_type(event: Event) -> str:
    """What an event is called on the wire: "gesture", "onset" ..."""
    return type(event).__name__.lower()


def to_json(event: Event, epoch: float, *, test: bool = False) -> bytes:
    """One JSON line. Stream time + `epoch` s = time since the Unix epoch; with `test` it has the key `"test":true`.

    Raises ValueError for a NaN or an infinity, which no event may hold.
    """
    kind = event_type(event)
    line: dict[str, Any] = {"type": kind}
    for name, is_time, unsaid in _FIELDS[kind]:
        value = getattr(event, name)
        if value != unsaid:
            line[name] = value + epoch if is_time and value is not None else value
    if test:
        line["test"] = True
    return json_line(line)


class Hello(TypedDict):
    """What the first line to a client says."""

    version: str
    instance: str
    model: str
    gestures: Sequence[str]
    sensors: Mapping[str, int]  # by sensor: its last sequence
    gates: Mapping[str, Mapping[str, Any]]  # by sensor: its gates and arming


def hello_json(**told: Unpack[Hello]) -> bytes:
    """The first line to a client."""
    return json_line({"type": "hello", "protocol": 1, **told})


def gestures_json(gestures: Sequence[str]) -> bytes:
    """The line with the gestures that there are from now on, the user's own after the model's."""
    return json_line({"type": "gestures", "gestures": list(gestures)})


def lost_json(count: int) -> bytes:
    """The line that tells a client how many lines it has missed because it was too slow."""
    return json_line({"type": "lost", "count": count})


def error_json(reason: str) -> bytes:
    """The line that tells a client what was wrong with its request."""
    return json_line({"type": "error", "reason": reason})


def quoted(value: object) -> str:
    """What a peer sent as an answer quotes it: JSON, cut after LONGEST characters."""
    text = json.dumps(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def json_line(value: Mapping[str, Any]) -> bytes:
    """An object as a line of one of the daemon's sockets. Raises ValueError for a NaN or an infinity."""
    return _ENCODER.encode(value).encode() + b"\n"


def _plain_value(value: Any) -> Any:
    """The plain value that JSON knows for a mapping of any kind, for `Where`, or for a number of numpy's."""
    if isinstance(value, Where | Place):
        return {name: getattr(value, name) for name in value.__slots__}  # `asdict` would copy each value
    return dict(value) if isinstance(value, Mapping) else value.item()


_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False, default=_plain_value)


@dataclass(frozen=True, slots=True)
class Subscription:
    """Which events a client wants to hear; a filter that is None lets all of them pass."""

    types: frozenset[str] = frozenset(("gesture",))
    sensors: frozenset[str] | None = None
    gestures: frozenset[str] | None = None
    zones: frozenset[str] | None = None

    @property
    def costly(self) -> bool:
        """Whether it asks for events that are made only if somebody asks for them."""
        return not self.types.isdisjoint(("provisional", "touch"))

    def matches(self, event: Event) -> bool:
        """Whether the client wants to hear an event; a filter lets events pass that have nothing to compare with it.

        `sensors` filters events of one sensor, `gestures` those with a gesture's name, `zones` those with a place.
        """
        if event_type(event) not in self.types:
            return False
        if self.sensors is not None and not isinstance(event, Status) and event.sensor not in self.sensors:
            return False
        if self.zones is not None and isinstance(event, Gesture | Unknown | Touch):
            place = event if isinstance(event, Touch) else event.where
            if place is None or place.zone not in self.zones:
                return False
        return self.gestures is None or not isinstance(event, Gesture | Provisional) or event.gesture in self.gestures


def parse_subscription(line: bytes, known: Mapping[str, Collection[str]]) -> Subscription:
    """A client's request, `{"subscribe": {...}}`. Raises ProtocolError, whose text says what was expected.

    `known` are the `gestures` and `zones` that a client may name. A sensor may be named before it comes.
    """
    if len(line) > MAX_LINE:
        raise _refused(f"a request has at most {MAX_LINE} bytes, found {len(line)}")
    try:
        request = json.loads(line.decode())
    except UnicodeDecodeError:
        raise _refused("a request is UTF-8") from None
    except (ValueError, RecursionError):
        raise _refused('expected one JSON object a line, as {"subscribe":{"types":["gesture"]}}') from None
    wanted = request.get("subscribe") if isinstance(request, dict) and len(request) == 1 else None
    if not isinstance(wanted, dict):
        raise _refused('expected one key "subscribe" with an object, as {"subscribe":{"types":["gesture"]}}')
    keys = {"types": EVENT_TYPES, "sensors": (), **known}
    return Subscription(**{key: _names(key, value, keys) for key, value in wanted.items()})


def _names(key: str, value: object, known: Mapping[str, Collection[str]]) -> frozenset[str]:
    """One filter of a request; `known`: by key, the names that it may hold. Raises ProtocolError."""
    if key not in known:
        raise _refused(f"subscribe: unknown key {quoted(key)}, expected types, sensors, gestures or zones")
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise _refused(f"subscribe.{key}: expected a list of strings")
    for item in value:
        if key == "sensors":
            if not is_sensor(item):
                raise _refused(f"subscribe.sensors: {quoted(item)} cannot be a sensor's name")
        elif (key, item) == ("types", "touch") and item not in known[key]:
            raise _refused('subscribe.types: "touch" is off, expected `touch = true` in the configuration')
        elif item not in known[key]:
            expected = f"any of {', '.join(known[key])}" if known[key] else f"none, since no {key} are configured"
            raise _refused(f"subscribe.{key}: unknown {quoted(item)}, expected {expected}")
    return frozenset(value)


def _refused(text: str) -> ProtocolError:
    return ProtocolError("subscription", text)
