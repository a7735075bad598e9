"""Events as messages of gestured_msgs, whose fields have the names that the event's JSON has."""

from collections.abc import Mapping
from typing import Any

from gestured.core.errors import SettingsError

TIME = "builtin_interfaces/Time"
LIMITS = {TIME: 2**31, "uint8": 2**8, "uint32": 2**32, "uint64": 2**64}  # kind of a number -> what it is below


def own_messages() -> dict[str, Any]:
    """The message of each type of event that has one. Raises SettingsError where gestured_msgs is not there."""
    try:
        from gestured_msgs.msg import Gesture, Provisional, Status, Touch
    except ImportError:
        raise SettingsError("parameter messages: the package gestured_msgs is not there: build it, too") from None
    return {"gesture": Gesture, "provisional": Provisional, "status": Status, "touch": Touch}


def filled(message: Any, event: Mapping[str, Any]) -> Any:
    """The message with an event's values. What the event leaves out, or says as null, stays empty, 0 or false.

    Raises ValueError for a number that has no place in its field: ROS would send another one.
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
