"""Zones of a sensor: rectangles that share no place. The one in which a contact begins is its zone."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gestured.core.address import is_sensor
from gestured.core.events import Place

MOST_ZONES = 64  # of one sensor: each is held against each other one, and a tape may come from anybody


@dataclass(frozen=True, slots=True)
class Zone:
    """One zone, half open but for the sensor's own last edges."""

    at: tuple[float, float, float, float]  # left, bottom, right, top: fractions of the sensor as a person sees it
    gestures: tuple[str, ...] | None = None  # those that may begin here; None is all

    def holds(self, place: Place) -> bool:
        """Whether a place lies in it."""
        left, bottom, right, top = self.at
        across = left <= place.x < right or place.x == right == 1
        return across and (bottom <= place.y < top or place.y == top == 1)


def zone_at(zones: Mapping[str, Zone], place: Place) -> str | None:
    """The name of the zone in which a place lies; None where it is none."""
    return next((name for name, zone in zones.items() if zone.holds(place)), None)


def zones_of(told: Mapping[str, Any]) -> dict[str, Zone]:
    """Zones by name, each told as its four numbers or as a mapping with `at` and perhaps `gestures`.

    Raises ValueError, which names the zone, or both where two overlap.
    """
    if len(told) > MOST_ZONES:
        raise ValueError(f"zones: expected at most {MOST_ZONES} of a sensor, found {len(told)}")
    zones: dict[str, Zone] = {}
    for name, each in told.items():
        new = zones[name] = _zone(name, each)
        for other, zone in zones.items():
            if zone is not new and all(zone.at[k] < new.at[k + 2] and new.at[k] < zone.at[k + 2] for k in (0, 1)):
                where = f"zones.{other} at {list(zone.at)} and zones.{name} at {list(new.at)}"
                raise ValueError(f"{where} overlap, expected zones that share no place")
    return zones


def _zone(name: str, told: Any) -> Zone:
    """One zone. Raises ValueError."""
    parts = told if isinstance(told, Mapping) else {"at": told}
    if not is_sensor(name) or not parts.keys() <= {"at", "gestures"}:
        raise ValueError(f"zones.{name}: expected a name of A-Z a-z 0-9 _ - with `at` and `gestures`, found {told!r}")
    at: Any = parts.get("at")
    gestures: Any = parts.get("gestures")
    sound = isinstance(at, list | tuple) and len(at) == 4 and all(type(number) in (int, float) for number in at)
    if not (sound and 0 <= at[0] < at[2] <= 1 and 0 <= at[1] < at[3] <= 1):  # so NaN is none
        expected = (
            "[left, bottom, right, top] in fractions of the sensor, 0 <= left < right <= 1 and bottom < top alike"
        )
        raise ValueError(f"zones.{name}: at {at!r}: expected {expected}")
    if not (gestures is None or (isinstance(gestures, list | tuple) and all(type(each) is str for each in gestures))):
        raise ValueError(f"zones.{name}: gestures {gestures!r}: expected a list of names")
    return Zone(tuple(at), None if gestures is None else tuple(gestures))
