"""The people who perform: participants with their habits, and the presses and artefacts of a performance.

A contact's size grows with its force: the radius of a pressed sphere with F^(1/3) (Hertz), that of these fingers with
F^0.08 to F^0.35. Tremor is the physiological one of 8 to 12 Hz, with hundredths to tenths of a mm. Arm poses turn
strokes, which bend about wrist or elbow. The distributions are invented within plausible bounds.
"""

import math
from dataclasses import dataclass

import numpy as np

from gestured.simulator.kinematics import Array

SPEEDS = {"slow": 0.55, "normal": 1.0, "fast": 1.8}
INCLINATIONS = (0, 1, 2)


def generator(*key: int) -> np.random.Generator:
    """The random generator for an integer key: the same on every run and machine, independent of other keys."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([int(k) & 0xFFFFFFFFFFFFFFFF for k in key])))


def any_speed(rng: np.random.Generator) -> str:
    """One of SPEEDS, all equally likely."""
    return tuple(SPEEDS)[int(rng.integers(len(SPEEDS)))]


@dataclass(frozen=True, slots=True, eq=False)
class Press:
    """One finger (or palm, or thing) on the pad; arrays are (n,) on a fine grid of increasing times.

    There is no contact before the first and after the last time. Positions are millimetres from the pad's bottom-left
    corner, x to the right, y upward. `force` is relative: 1 is a normal firm finger.
    """

    t: Array  # s
    x: Array
    y: Array
    force: Array
    length: float  # millimetres, one standard deviation of the footprint along `angle` at force 1
    width: float  # the same, across `angle`
    angle: float = 0.0
    growth: float = 0.2  # size ~ force ** growth
    flatness: float = 1.0  # exponent of the super-Gaussian footprint: 1 Gaussian, 2 flat-topped
    finger: bool = True  # whether a sensor with finger tracking reports it


@dataclass(frozen=True, slots=True)
class Artefact:
    """Counts without a touch: `form` is "all", "row", "column", "block", "taxels" or "taxel"."""

    start: float  # s
    stop: float  # s
    form: str
    height: float  # relative to a normal finger's counts; may be negative
    flicker: float = 1.0  # 0: steady; 1: a new random height in each frame


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


class Participant:
    """A person's hand and habits, all drawn from the integer `seed`."""

    def __init__(self, seed: int) -> None:
        rng = generator(seed, 0x9E0)
        self.seed = seed
        self.finger_mm = float(np.clip(3.7 * rng.lognormal(0.0, 0.24), 2.2, 7.0))  # index finger, one deviation
        self.oblong = float(rng.uniform(1.0, 1.7))  # its length over its width
        self.growth = float(rng.uniform(0.08, 0.35))
        self.force = float(np.clip(rng.lognormal(0.0, 0.35), 0.35, 2.5))
        self.force_spread = float(rng.uniform(0.08, 0.35))
        self.pace = float(np.clip(rng.lognormal(0.0, 0.22), 0.55, 1.8))  # factor on all speeds
        self.pace_spread = float(rng.uniform(0.06, 0.25))
        self.reach = float(rng.beta(1.6, 1.4))  # preferred size of gestures, 0 small to 1 the whole pad
        self.place = float(rng.normal(0.0, 0.25)), float(rng.normal(0.0, 0.25))  # preferred; -1..1 from centre to edge
        self.place_spread = float(rng.uniform(0.1, 0.6))
        self.bias = float(np.clip(rng.normal(0.0, math.radians(5.0)), -0.2, 0.2))  # radians by which "up" is turned
        self.aim = math.radians(float(rng.uniform(2.0, 7.0)))  # radians, spread of the directions of strokes
        self.tremor_mm = float(rng.uniform(0.02, 0.25))
        self.wobble_mm = float(rng.uniform(0.1, 1.1))
        self.tap_s = float(np.clip(0.18 * rng.lognormal(0.0, 0.4), 0.06, 0.4))
        self.gap_s = float(np.clip(0.19 * rng.lognormal(0.0, 0.32), 0.1, 0.36))  # between two taps
        self.rest_end = float(rng.beta(1.3, 1.2))  # 0..1, how often and how long a stroke ends at rest
        self.rest_start = float(rng.beta(1.1, 2.0))
        self.glide = float(rng.beta(1.1, 1.2))  # 0..1, how often a finger lands and leaves while it moves
        self.spacing_mm = float(np.clip(21.0 * rng.lognormal(0.0, 0.25), 12.0, 40.0))  # between two fingertips
        self.clumsy = float(rng.beta(0.6, 3.0))  # 0..1, how often the hand or a second finger rests on the pad
        self.right_handed = bool(rng.random() < 0.85)
        side = 1.0 if self.right_handed else -1.0
        # The finger points in from the hand's side (radians). Strokes bend about the wrist (short radius) or the elbow.
        self.finger_angle = math.pi / 2.0 + side * float(rng.normal(0.35, 0.45))
        wrist = rng.random() < 0.5
        radius = rng.uniform(60.0, 150.0) if wrist else rng.uniform(250.0, 350.0)
        self.bend = side * float(rng.choice([1.0, 1.0, -0.6])) / float(radius)  # 1/mm, signed

    def pose(self, inclination: int) -> tuple[float, float, float]:
        """The arm pose at one of three inclinations: (turn in radians, extent factor, force factor)."""
        rng = generator(self.seed, 0x905E, inclination)
        step = inclination - 1
        turn = float(rng.normal(0.0, math.radians(3.0))) + step * math.radians(2.0) * (1 if self.right_handed else -1)
        grow = float(rng.uniform(0.85, 1.1)) - 0.04 * step
        return turn, grow, float(rng.lognormal(0.0, 0.12)) * (1.0 - 0.1 * step)

    def rate(self, rng: np.random.Generator, speed: str) -> float:
        """The factor on the speed of one movement: from habit, the intended `speed` and chance."""
        return SPEEDS[speed] * self.pace * float(np.clip(rng.lognormal(0.0, self.pace_spread), 0.5, 2.0))
