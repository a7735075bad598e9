"""What a client of the event socket is told: events and the other lines, as JSON."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, get_args

from gestured.core.events import Event


def json_object(text: str | bytes) -> dict[str, Any] | None:
    """The JSON object in somebody else's text, bytes as UTF-8; None where it is anything else, or nested too deeply."""
    try:
        found = json.loads(text.decode() if isinstance(text, bytes) else text)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def event_type(event: Event) -> str:
    """What an event is called on the wire: "gesture", "onset" ..."""
    return type(event).__name__.lower()


LONGEST = 60  # characters of what a peer sent, in an answer to it
EVENT_TYPES = tuple(cls.__name__.lower() for cls in get_args(Event))
_STREAM_TIMES = frozenset(("onset", "offset", "decided"))


def to_json(event: Event, epoch: float, *, test: bool = False) -> bytes:
    """One JSON line; stream time + `epoch` s = time since the Unix epoch. A test's has one key more: `"test":true`.

    Raises ValueError for a NaN or an infinity, which no event may hold.
    """
    line: dict[str, Any] = {"type": event_type(event)}
    for field in fields(event):
        value = getattr(event, field.name)
        if value is False and field.name == "own":
            continue  # said of the user's own gestures alone
        line[field.name] = value + epoch if field.name in _STREAM_TIMES else value
    if test:
        line["test"] = True
    return _line(line)


def hello_json(version: str, instance: str, model: str, gestures: Sequence[str], sensors: Mapping[str, int]) -> bytes:
    """The first line to a client; `sensors` has the last sequence of each."""
    return _line(
        {
            "type": "hello",
            "protocol": 1,
            "version": version,
            "instance": instance,
            "model": model,
            "gestures": list(gestures),
            "sensors": dict(sensors),
        }
    )


def gestures_json(gestures: Sequence[str]) -> bytes:
    """Tells every client which gestures there are from now on, the user's own after the model's."""
    return _line({"type": "gestures", "gestures": list(gestures)})


def lost_json(count: int) -> bytes:
    """Tells a client how many lines it was too slow for."""
    return _line({"type": "lost", "count": count})


def error_json(reason: str) -> bytes:
    """Tells a client what was wrong with its request."""
    return _line({"type": "error", "reason": reason})


def quoted(value: object) -> str:
    """How an answer names what a peer sent: as JSON, cut where it is long."""
    text = json.dumps(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def _line(value: dict[str, Any]) -> bytes:
    return _ENCODER.encode(value).encode() + b"\n"


def _plain_value(value: Any) -> Any:
    """Mappings of any kind, and numpy's numbers."""
    return dict(value) if isinstance(value, Mapping) else value.item()


_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False, default=_plain_value)
