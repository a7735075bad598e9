"""Events as messages of gestured_msgs, whose fields have the names of the keys in an event's JSON."""

from collections.abc import Mapping
from typing import Any

from gestured.core.errors import SettingsError

TIME = "builtin_interfaces/Time"
LIMITS = {TIME: 2**31, "uint8": 2**8, "uint32": 2**32, "uint64": 2**64}  # by type: what numbers must be below


def own_messages() -> dict[str, Any]:
    """By type of event: its message. Raises SettingsError if the package gestured_msgs is not installed."""
    try:
        from gestured_msgs.msg import Gesture, Provisional, Status, Touch
    except ImportError:
        raise SettingsError("parameter messages: the package gestured_msgs is not there: build it, too") from None
    return {"gesture": Gesture, "provisional": Provisional, "status": Status, "touch": Touch}


def filled(message: Any, event: Mapping[str, Any]) -> Any:
    """The message with an event's values. Fields that the event does not have, or has as null, stay as they are.

    Raises ValueError for a number that does not fit its field, since ROS would send another one.
    """
    for name, kind in message.get_fields_and_field_types().items():
        value, field = event.get(name), getattr(message, name)
        if value is None:
            continue
        if kind in LIMITS and not 0 <= value < LIMITS[kind]:
            raise ValueError(f"{name} {value}: expected {kind}")
        if kind == TIME:
            field.sec, field.nanosec = divmod(round(1e9 * value), 10**9)
        elif kind.startswith("gestured_msgs/"):
            filled(field, value)
        else:
            setattr(message, name, type(field)(value))
    return message
