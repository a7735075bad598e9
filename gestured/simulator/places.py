"""The places where a sensor may be, and what rests and happens there: everyday life as one table.

Each number in `PLACES` and `FINGERS`, and in `POSTURES` of `resting`, has its source or is assumed. If you change one,
print the figures with the old and the new number.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from gestured.simulator.gestures import one_tap
from gestured.simulator.occasion import Maker, Occasion
from gestured.simulator.people import Press
from gestured.simulator.resting import HAND, NOBODY, POSTURES, THING, rest
from gestured.simulator.unmeant import SHORT, Places

# What the fingers of a resting hand do: times an hour of rest; assumed.
FINGERS: Mapping[str, float] = {
    "playing_tap": 240.0, "playing_drum": 60.0, "playing_rub": 90.0, "playing_press": 40.0, "playing_stretch": 40.0,
}  # fmt: skip
HAPPENINGS: Mapping[str, Maker] = {"idle_tap": one_tap, **SHORT}
# Makes something that rests, from an occasion, the seconds and the road: its presses, and where its fingers lie (mm).
Resting = Callable[[Occasion, float, float], tuple[list[Press], Places]]
RESTS: Mapping[str, tuple[Resting, float]] = {  # by posture: its maker, and its median dwell time in s
    name: (partial(rest, name), posture.dwell_s) for name, posture in POSTURES.items()
}


@dataclass(frozen=True)
class Place:
    """A place of a sensor: the postures there, what happens beside them, and how the road shakes them."""

    name: str
    postures: Mapping[str, float]  # how often each is taken, in relation to the others
    rates: Mapping[str, float]  # by kind: happenings an hour; all assumed
    road: float  # share of the force by which the road shakes it, one standard deviation
    meant: float  # meant gestures an hour
    rests: Mapping[str, tuple[Resting, float]] = field(default_factory=lambda: RESTS)
    happenings: Mapping[str, Maker] = field(default_factory=lambda: HAPPENINGS)


# What may happen anywhere: times an hour; all assumed.
ANYWHERE: Mapping[str, float] = {
    "sleeve_brush": 15.0, "bump": 20.0, "graze": 20.0, "landing": 12.0, "pat": 5.0, "poke": 3.0, "slide": 3.0,
    "fold": 6.0, "fidget": 6.0, "hands": 1.5, "wipe": 2.0, "palm": 3.0, "object_put_down": 3.0, "wrinkle": 3.0,
    "long_press": 2.0, "press_and_slide": 1.0,
    "idle_tap": 8.0,  # only while nothing rests there; the fingers of a resting hand tap as FINGERS says
}  # fmt: skip
_PLACES = (
    Place(
        "armrest", {NOBODY: 3.0, "forearm": 3.0, "elbow": 1.5, HAND: 1.5, "push_off": 0.5},
        {**ANYWHERE, "sleeve_brush": 30.0}, 0.06, 45.0,
    ),
    Place(
        "door", {NOBODY: 4.0, "elbow": 3.0, "forearm": 2.0, "push_off": 1.0, HAND: 1.0},
        {**ANYWHERE, "sleeve_brush": 30.0, "bump": 30.0, "palm": 6.0}, 0.09, 45.0,
    ),
    Place(
        "seat", {"body": 6.0, NOBODY: 1.0, HAND: 0.5, THING: 1.0},
        {**ANYWHERE, "wrinkle": 25.0, "fold": 20.0, "idle_tap": 4.0, "fidget": 3.0}, 0.12, 20.0,
    ),
    Place(
        "skin", {NOBODY: 6.0, HAND: 1.5, "body": 0.5},
        {**ANYWHERE, "palm": 10.0, "pat": 12.0, "hands": 6.0, "idle_tap": 12.0}, 0.02, 90.0,
    ),
    Place(
        "table", {NOBODY: 4.0, "forearm": 2.0, HAND: 2.0, THING: 3.0},
        {**ANYWHERE, "object_put_down": 15.0, "slide": 20.0, "poke": 6.0, "wipe": 6.0, "fidget": 12.0,
         "idle_tap": 12.0}, 0.0, 60.0,
    ),
)  # fmt: skip
PLACES: Mapping[str, Place] = {place.name: place for place in _PLACES}
