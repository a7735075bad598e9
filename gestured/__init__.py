"""gestured: real-time tactile gesture recognition, as a daemon and as a library (docs/embedding.md)."""

__version__ = "0.2.0"

# Each name is imported from its module when it is first used, so that importing the package imports nothing else. Type
# checkers take TYPE_CHECKING for true; the constant of `typing` would have to be imported.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from gestured.client.subscriber import Subscriber
    from gestured.core.errors import GesturedError
    from gestured.core.events import (
        Cancelled,
        Event,
        Gate,
        Gesture,
        Onset,
        Provisional,
        Release,
        Status,
        TouchEvent,
        Unknown,
    )
    from gestured.core.frames import Frame, Touch
    from gestured.core.hub import Hub
    from gestured.core.scene import Scene
    from gestured.core.sensor import Sensor
    from gestured.core.sensor import Sensor as Recognizer
    from gestured.model.embedded import Embedded, open

__all__ = [
    "Cancelled",
    "Embedded",
    "Event",
    "Frame",
    "Gate",
    "Gesture",
    "GesturedError",
    "Hub",
    "Onset",
    "Provisional",
    "Recognizer",
    "Release",
    "Scene",
    "Sensor",
    "Status",
    "Subscriber",
    "Touch",
    "TouchEvent",
    "Unknown",
    "open",
]

# The module of each name; all others are those of events.
_HOMES = {
    "Embedded": "model.embedded",
    "Frame": "core.frames",
    "GesturedError": "core.errors",
    "Hub": "core.hub",
    "Recognizer": "core.sensor",
    "Scene": "core.scene",
    "Sensor": "core.sensor",
    "Subscriber": "client.subscriber",
    "Touch": "core.frames",
    "open": "model.embedded",
}


if not TYPE_CHECKING:  # a type checker would take any name for one of the package's

    def __getattr__(name: str) -> object:
        from importlib import import_module

        if name not in __all__:
            raise AttributeError(f"module 'gestured' has no attribute {name!r}")
        found: object = getattr(import_module(f"gestured.{_HOMES.get(name, 'core.events')}"), name)
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
