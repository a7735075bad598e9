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

_HOMES = {
    "client.subscriber": ("Subscriber",),
    "core.errors": ("GesturedError",),
    "core.events": (
        "Cancelled",
        "Event",
        "Gate",
        "Gesture",
        "Onset",
        "Provisional",
        "Release",
        "Status",
        "TouchEvent",
        "Unknown",
    ),
    "core.frames": ("Frame", "Touch"),
    "core.hub": ("Hub",),
    "core.scene": ("Scene",),
    "core.sensor": ("Recognizer", "Sensor"),
    "model.embedded": ("Embedded", "open"),
}


def __getattr__(name: str) -> object:
    from importlib import import_module

    for home, names in _HOMES.items():
        if name in names:
            found: object = getattr(import_module(f"gestured.{home}"), name)
            globals()[name] = found
            return found
    raise AttributeError(f"module 'gestured' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
