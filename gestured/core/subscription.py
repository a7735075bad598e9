"""What a client asks to hear: one JSON line. A bad one is a ProtocolError with the reason `subscription`."""

import json
from collections.abc import Collection
from dataclasses import dataclass

from gestured.core.errors import ProtocolError
from gestured.core.events import Event, Gesture, Provisional, Status
from gestured.core.messages import EVENT_TYPES, event_type, quoted
from gestured.core.wire import is_sensor

MAX_LINE = 4096  # bytes of a client's request


@dataclass(frozen=True, slots=True)
class Subscription:
    """What a client wants to hear; None is no filter."""

    types: frozenset[str] = frozenset(("gesture",))
    sensors: frozenset[str] | None = None
    gestures: frozenset[str] | None = None

    @property
    def foresees(self) -> bool:
        """Whether it asks for provisional events."""
        return "provisional" in self.types

    def matches(self, event: Event) -> bool:
        """`sensors` filters what is one sensor's, `gestures` what has a gesture's name; the rest passes."""
        if event_type(event) not in self.types:
            return False
        if self.sensors is not None and not isinstance(event, Status) and event.sensor not in self.sensors:
            return False
        return self.gestures is None or not isinstance(event, Gesture | Provisional) or event.gesture in self.gestures


def parse_subscription(line: bytes, gestures: Collection[str]) -> Subscription:
    """A client's request, `{"subscribe": {...}}`; raises ProtocolError whose text says what was expected.

    `gestures` are those that there are. A sensor may be named before it comes.
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
    given: dict[str, frozenset[str]] = {}
    for key, value in wanted.items():
        if key not in ("types", "sensors", "gestures"):
            raise _refused(f"subscribe: unknown key {quoted(key)}, expected types, sensors or gestures")
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise _refused(f"subscribe.{key}: expected a list of strings")
        for item in value:
            if key == "types" and item not in EVENT_TYPES:
                raise _refused(f"subscribe.types: unknown {quoted(item)}, expected any of {', '.join(EVENT_TYPES)}")
            if key == "gestures" and item not in gestures:
                raise _refused(f"subscribe.gestures: unknown {quoted(item)}, expected any of {', '.join(gestures)}")
            if key == "sensors" and not is_sensor(item):
                raise _refused(f"subscribe.sensors: {quoted(item)} cannot be a sensor's name")
        given[key] = frozenset(value)
    return Subscription(**given)


def _refused(text: str) -> ProtocolError:
    return ProtocolError("subscription", text)
