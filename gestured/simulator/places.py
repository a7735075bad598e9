"""Where a sensor may be, and what rests and happens there: everyday life as one table.

`PLACES` and `FINGERS` here and `POSTURES` in `resting`: each number has its source, or is assumed. Whoever changes one
prints the figures with both.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from gestured.simulator.gestures import one_tap
from gestured.simulator.occasion import Maker, Occasion
from gestured.simulator.people import Press
from gestured.simulator.resting import HAND, NOBODY, POSTURES, THING, rest
from gestured.simulator.unmeant import SHORT, Places

# What the fingers of a hand that rests do, an hour of such rest; assumed.
FINGERS: Mapping[str, float] = {
    "playing_tap": 240.0,
    "playing_drum": 60.0,
    "playing_rub": 90.0,
    "playing_press": 40.0,
    "playing_stretch": 40.0,
}
HAPPENINGS: Mapping[str, Maker] = {"idle_tap": one_tap, **SHORT}
# What makes something that rests of an occasion, its seconds and the road: its presses, and where its fingers lie.
Resting = Callable[[Occasion, float, float], tuple[list[Press], Places]]
RESTS: Mapping[str, tuple[Resting, float]] = {  # with the median dwell time in s
    name: (partial(rest, name), posture.dwell_s) for name, posture in POSTURES.items()
}


@dataclass(frozen=True)
class Place:
    """Where a sensor is: its postures by share, what happens beside them an hour, and how the road shakes it."""

    name: str
    postures: Mapping[str, float]
    rates: Mapping[str, float]  # happenings an hour; all assumed
    road: float  # of the force, one standard deviation
    meant: float  # gestures an hour
    rests: Mapping[str, tuple[Resting, float]] = field(default_factory=lambda: RESTS)
    happenings: Mapping[str, Maker] = field(default_factory=lambda: HAPPENINGS)


# What may happen anywhere, an hour; all assumed.
ANYWHERE: Mapping[str, float] = {
    "sleeve_brush": 15.0,
    "bump": 20.0,
    "graze": 20.0,
    "landing": 12.0,
    "pat": 5.0,
    "poke": 3.0,
    "slide": 3.0,
    "fold": 6.0,
    "fidget": 6.0,
    "hands": 1.5,
    "wipe": 2.0,
    "palm": 3.0,
    "object_put_down": 3.0,
    "wrinkle": 3.0,
    "long_press": 2.0,
    "press_and_slide": 1.0,
    "idle_tap": 8.0,  # of a free hand, while nobody lies there; one that lies plays by FINGERS
}
PLACES: Mapping[str, Place] = {
    "armrest": Place(
        "armrest",
        {NOBODY: 3.0, "forearm": 3.0, "elbow": 1.5, HAND: 1.5, "push_off": 0.5},
        {**ANYWHERE, "sleeve_brush": 30.0},
        0.06,
        45.0,
    ),
    "door": Place(
        "door",
        {NOBODY: 4.0, "elbow": 3.0, "forearm": 2.0, "push_off": 1.0, HAND: 1.0},
        {**ANYWHERE, "sleeve_brush": 30.0, "bump": 30.0, "palm": 6.0},
        0.09,
        45.0,
    ),
    "seat": Place(
        "seat",
        {"body": 6.0, NOBODY: 1.0, HAND: 0.5, THING: 1.0},
        {**ANYWHERE, "wrinkle": 25.0, "fold": 20.0, "idle_tap": 4.0, "fidget": 3.0},
        0.12,
        20.0,
    ),
    "skin": Place(
        "skin",
        {NOBODY: 6.0, HAND: 1.5, "body": 0.5},
        {**ANYWHERE, "palm": 10.0, "pat": 12.0, "hands": 6.0, "idle_tap": 12.0},
        0.02,
        90.0,
    ),
    "table": Place(
        "table",
        {NOBODY: 4.0, "forearm": 2.0, HAND: 2.0, THING: 3.0},
        {
            **ANYWHERE,
            "object_put_down": 15.0,
            "slide": 20.0,
            "poke": 6.0,
            "wipe": 6.0,
            "fidget": 12.0,
            "idle_tap": 12.0,
        },
        0.0,
        60.0,
    ),
}
