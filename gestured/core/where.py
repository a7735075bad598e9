"""Where a segment was, how far it went and how hard it pressed, as events say beside its name.

A sensor's zones are rectangles that share no place. The one in which a contact begins is its zone.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.address import is_sensor
from gestured.core.contact import RESTS
from gestured.core.events import Place, Where
from gestured.core.frames import SMALLEST, Segment
from gestured.core.spots import places

Array = NDArray[np.float64]

MOST = 100  # the most frames of a segment that are used, evenly spread: 20 a second for the longest contact of 5 s
SEEN = 0.3  # of the segment's peak: only stronger frames say where the finger is
BOTH = 0.5  # of the segment's peak: only stronger frames say, by more than half of them, whether there are two fingers
SHAKE = 4.0  # taxel pitches: the uncertainty of a place whose peak is as high as the noise; it falls as the peak rises
FINE = 1e4  # parts of a sensor's side to which places are rounded; `round` to four digits takes twice the time
UNDER = 1.0  # taxel pitches: a bad taxel that is so near to the way counts as under it
MOST_ZONES = 64  # the most of one sensor: each is compared with each other, and a tape may come from anybody


@dataclass(frozen=True, slots=True)
class Zone:
    """One zone of a sensor. Its right and top edges belong to it only where they are the sensor's own."""

    at: tuple[float, float, float, float]  # left, bottom, right, top: fractions of the sensor as a person sees it
    gestures: tuple[str, ...] | None = None  # the gestures that may begin here; None is all

    def holds(self, place: Place) -> bool:
        """Whether a place lies in the zone."""
        left, bottom, right, top = self.at
        across = left <= place.x < right or place.x == right == 1
        return across and (bottom <= place.y < top or place.y == top == 1)


def zone_at(zones: Mapping[str, Zone], place: Place) -> str | None:
    """The name of the zone in which a place lies; None if there is none."""
    return next((name for name, zone in zones.items() if zone.holds(place)), None)


def zones_of(told: Mapping[str, Any]) -> dict[str, Zone]:
    """Zones by name, from a setting with four numbers for each, or a mapping with `at` and perhaps `gestures`.

    Raises ValueError, which names the zone, or both zones if two overlap.
    """
    if not isinstance(told, Mapping):
        raise ValueError(f"zones: expected four numbers for each name, found {told!r}")
    if len(told) > MOST_ZONES:
        raise ValueError(f"zones: expected at most {MOST_ZONES} of a sensor, found {len(told)}")
    zones: dict[str, Zone] = {}
    for name, each in told.items():
        new = zones[name] = _zone(name, each)
        for other, zone in zones.items():
            if zone is not new and all(zone.at[k] < new.at[k + 2] and new.at[k] < zone.at[k + 2] for k in (0, 1)):
                those = f"zones.{other} at {list(zone.at)} and zones.{name} at {list(new.at)}"
                raise ValueError(f"{those} overlap, expected zones that share no place")
    return zones


def _zone(name: str, told: Any) -> Zone:
    """One zone. Raises ValueError."""
    parts = told if isinstance(told, Mapping) else {"at": told}
    if not is_sensor(name) or not parts.keys() <= {"at", "gestures"}:
        raise ValueError(f"zones.{name}: expected a name of A-Z a-z 0-9 _ - with `at` and `gestures`, found {told!r}")
    at: Any = parts.get("at")
    gestures: Any = parts.get("gestures")
    sound = isinstance(at, list | tuple) and len(at) == 4 and all(type(number) in (int, float) for number in at)
    if not (sound and 0 <= at[0] < at[2] <= 1 and 0 <= at[1] < at[3] <= 1):  # NaN fails this, too
        expected = (
            "[left, bottom, right, top] in fractions of the sensor, 0 <= left < right <= 1 and bottom < top alike"
        )
        raise ValueError(f"zones.{name}: at {at!r}: expected {expected}")
    if not (gestures is None or (isinstance(gestures, list | tuple) and all(type(each) is str for each in gestures))):
        raise ValueError(f"zones.{name}: gestures {gestures!r}: expected a list of names")
    return Zone(tuple(at), None if gestures is None else tuple(gestures))


def where(segment: Segment, zones: Mapping[str, Zone]) -> Where:
    """The place of a segment, and in which of the sensor's zones it began. Any segment has one, whatever it shows."""
    touched = segment.frames[segment.first : segment.last + 1]
    rows, columns = touched.shape[1:]
    peaks = touched.max(axis=(1, 2)).astype(np.float64)
    top = float(peaks.max())
    seen = np.flatnonzero(peaks >= SEEN * top) if top > 0 else np.arange(len(touched))
    if len(seen) > MOST:
        seen = seen[np.rint(np.linspace(0, len(seen) - 1, MOST)).astype(int)]
    frames = touched[seen].astype(np.float64).reshape(len(seen), -1)
    found = [places(frame, (rows, columns), segment.noise) for frame in frames]
    two = [len(fingers) == 2 for fingers, peak in zip(found, peaks[seen].tolist(), strict=True) if peak >= BOTH * top]
    contacts = 2 if 2 * sum(two) > len(two) else 1
    path = [middle(fingers[:contacts]) for fingers in found if len(fingers) >= contacts]
    snr = top / max(segment.noise, SMALLEST)
    way = _way(path, RESTS + SHAKE / max(snr, 1.0))
    start, end = (Place(*fractions(rows, columns, row, column)) for row, column in (path[0], path[-1]))
    return Where(
        start,
        end,
        round(way / (min(rows, columns) - 1), 4),
        digits(top),
        digits(snr),
        contacts,
        0 if segment.bad is None or not segment.bad.any() else _under(segment.bad, np.array(path)),
        zone_at(zones, start),
    )


def middle(fingers: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """The row and column of one finger, or half-way between two."""
    (row, column), (down, across) = fingers[0], fingers[-1]
    return (row + down) / 2, (column + across) / 2


def fractions(rows: int, columns: int, row: float, column: float) -> tuple[float, float]:
    """A row and a column of a grid as fractions (x, y) of its sides, to the right and upward."""
    return round(column / (columns - 1) * FINE) / FINE, round((1.0 - row / (rows - 1)) * FINE) / FINE


def _way(path: Sequence[tuple[float, float]], rests: float) -> float:
    """The length of a path in taxel pitches, between places at least `rests` apart; 0 if it never goes so far."""
    length, last = 0.0, path[0]
    for each in path:
        step = math.dist(last, each)
        if step >= rests:
            length, last = length + step, each
    return length + math.dist(last, path[-1]) if length else 0.0


def _under(bad: NDArray[np.bool_], path: Array) -> int:
    """How many of the (R, C) `bad` taxels lie within `UNDER` of an (n, 2) path."""
    taxels = np.argwhere(bad)[:, None].astype(np.float64)  # (B, 1, 2)
    begin, step = path, np.diff(path, axis=0, append=path[-1:])
    along = ((taxels - begin) * step).sum(axis=2) / np.maximum((step**2).sum(axis=1), 1e-12)
    nearest = begin + np.clip(along, 0.0, 1.0)[..., None] * step
    return int(np.count_nonzero((np.hypot(*(taxels - nearest).transpose(2, 0, 1)) <= UNDER).any(axis=1)))


def digits(value: float) -> float:
    """A number to six digits, since more would only make each line longer."""
    return float(f"{value:.6g}")
