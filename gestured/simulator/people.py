"""Who performs: participants with their habits, and what a finger leaves on the pad.

A contact's size grows with its force: Hertz gives F^(1/3) for a pressed sphere's radius; these people lie
between F^0.08 and F^0.35. Tremor is the physiological 8 to 12 Hz of some hundredths to tenths of a mm. Arm
poses turn and bend strokes about wrist or elbow. The distributions are invented within plausible bounds.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gestured.simulator.kinematics import Array

SPEEDS = {"slow": 0.55, "normal": 1.0, "fast": 1.8}
INCLINATIONS = (0, 1, 2)


def generator(*key: int) -> np.random.Generator:
    """A random stream of its own for an integer key: the same on every run and machine."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([int(k) & 0xFFFFFFFFFFFFFFFF for k in key])))


def any_speed(rng: np.random.Generator) -> str:
    """One of SPEEDS, each as likely."""
    return tuple(SPEEDS)[int(rng.integers(len(SPEEDS)))]


@dataclass(frozen=True, slots=True, eq=False)
class Press:
    """One finger (or palm, or thing) on the pad; arrays are (n,) on a fine grid of increasing times.

    Before the first and after the last time there is no contact. Positions are millimetres from the pad's
    bottom-left corner, x to the right, y upward. `force` is relative: 1 is a normal firm finger.
    """

    t: Array
    x: Array
    y: Array
    force: Array
    length: float  # millimetres, one standard deviation of the footprint along `angle` at force 1
    width: float  # the same, across
    angle: float = 0.0
    growth: float = 0.2  # size ~ force ** growth
    flatness: float = 1.0  # exponent of the super-Gaussian footprint: 1 Gaussian, 2 flat-topped
    finger: bool = True  # a sensor with finger tracking would report it


@dataclass(frozen=True, slots=True)
class Artefact:
    """Counts without a touch: `form` is "all", "row", "column", "block", "taxels" or "taxel"."""

    start: float
    stop: float
    form: str
    height: float  # relative to a normal finger's counts; may be negative
    flicker: float = 1.0  # 0 steady, 1 a fresh random height each frame


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """What one person did once, in continuous time from 0 to `duration_s`."""

    kind: str
    label: str
    contacts: tuple[Press, ...]
    duration_s: float
    speed: str
    inclination: int
    participant: int
    artefacts: tuple[Artefact, ...] = ()


@dataclass(frozen=True)
class Participant:
    """A person's hand and habits, all drawn from one integer `seed`."""

    seed: int
    finger_mm: float = field(init=False)  # footprint of the index finger, one standard deviation
    oblong: float = field(init=False)  # length over width of the footprint
    finger_angle: float = field(init=False)  # how the finger points on the pad, radians
    growth: float = field(init=False)
    force: float = field(init=False)
    force_spread: float = field(init=False)
    pace: float = field(init=False)  # factor on all speeds
    pace_spread: float = field(init=False)
    reach: float = field(init=False)  # preferred gesture size, 0 small .. 1 the whole pad
    place: tuple[float, float] = field(init=False)  # preferred place, -1..1 from the pad's centre
    place_spread: float = field(init=False)
    bias: float = field(init=False)  # radians: how this person's "up" is turned
    aim: float = field(init=False)  # radians, spread of directions
    bend: float = field(init=False)  # 1/mm, signed: strokes are arcs about wrist or elbow
    tremor_mm: float = field(init=False)
    wobble_mm: float = field(init=False)
    tap_s: float = field(init=False)
    gap_s: float = field(init=False)  # between the taps of a double tap
    rest_end: float = field(init=False)  # 0..1, how often and how long a stroke ends at rest
    rest_start: float = field(init=False)
    glide: float = field(init=False)  # 0..1, lands and leaves while moving
    spacing_mm: float = field(init=False)  # between two fingers
    clumsy: float = field(init=False)  # 0..1, heel of the hand or second finger rests on the pad
    right_handed: bool = field(init=False)

    def __post_init__(self) -> None:
        rng = generator(self.seed, 0x9E0)
        draw: dict[str, Any] = {
            "finger_mm": float(np.clip(3.7 * rng.lognormal(0.0, 0.24), 2.2, 7.0)),
            "oblong": float(rng.uniform(1.0, 1.7)),
            "growth": float(rng.uniform(0.08, 0.35)),
            "force": float(np.clip(rng.lognormal(0.0, 0.35), 0.35, 2.5)),
            "force_spread": float(rng.uniform(0.08, 0.35)),
            "pace": float(np.clip(rng.lognormal(0.0, 0.22), 0.55, 1.8)),
            "pace_spread": float(rng.uniform(0.06, 0.25)),
            "reach": float(rng.beta(1.6, 1.4)),
            "place": (float(rng.normal(0.0, 0.25)), float(rng.normal(0.0, 0.25))),
            "place_spread": float(rng.uniform(0.1, 0.6)),
            "bias": float(np.clip(rng.normal(0.0, math.radians(5.0)), -0.2, 0.2)),
            "aim": math.radians(float(rng.uniform(2.0, 7.0))),
            "tremor_mm": float(rng.uniform(0.02, 0.25)),
            "wobble_mm": float(rng.uniform(0.1, 1.1)),
            "tap_s": float(np.clip(0.18 * rng.lognormal(0.0, 0.4), 0.06, 0.4)),
            "gap_s": float(np.clip(0.19 * rng.lognormal(0.0, 0.32), 0.1, 0.36)),
            "rest_end": float(rng.beta(1.3, 1.2)),
            "rest_start": float(rng.beta(1.1, 2.0)),
            "glide": float(rng.beta(1.1, 1.2)),
            "spacing_mm": float(np.clip(21.0 * rng.lognormal(0.0, 0.25), 12.0, 40.0)),
            "clumsy": float(rng.beta(0.6, 3.0)),
            "right_handed": bool(rng.random() < 0.85),
        }
        side = 1.0 if draw["right_handed"] else -1.0
        # The finger comes from the hand's side; strokes bend about the wrist (short radius) or the elbow.
        draw["finger_angle"] = math.pi / 2.0 + side * float(rng.normal(0.35, 0.45))
        wrist = rng.random() < 0.5
        radius = rng.uniform(60.0, 150.0) if wrist else rng.uniform(250.0, 350.0)
        draw["bend"] = side * float(rng.choice([1.0, 1.0, -0.6])) / float(radius)
        for name, value in draw.items():
            object.__setattr__(self, name, value)

    def pose(self, inclination: int) -> tuple[float, float, float]:
        """The arm pose at one of three inclinations: (turn in radians, extent factor, force factor)."""
        rng = generator(self.seed, 0x905E, inclination)
        step = inclination - 1
        turn = float(rng.normal(0.0, math.radians(3.0))) + step * math.radians(2.0) * (1 if self.right_handed else -1)
        return (
            turn,
            float(rng.uniform(0.85, 1.1)) - 0.04 * step,
            float(rng.lognormal(0.0, 0.12)) * (1.0 - 0.1 * step),
        )

    def rate(self, rng: np.random.Generator, speed: str) -> float:
        """Factor on this movement's speed: habit, today's intention, chance."""
        return SPEEDS[speed] * self.pace * float(np.clip(rng.lognormal(0.0, self.pace_spread), 0.5, 2.0))
