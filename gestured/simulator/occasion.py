"""An occasion: one person about to do one thing, with its place, pace, force and finger."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from gestured.simulator.kinematics import Array, wander
from gestured.simulator.people import SPEEDS, Artefact, Participant, Press


@dataclass(frozen=True, slots=True)
class Occasion:
    """One person about to do one thing on a pad of `width` x `height` millimetres."""

    rng: np.random.Generator
    person: Participant
    width: float
    height: float
    speed: str
    rate: float  # factor on the speed of this movement
    turn: float  # radians by which directions are turned, from pose and habit
    grow: float  # factor on lengths, from the pose
    press: float  # factor on forces, from the pose

    @property
    def small(self) -> float:
        """The pad's shorter edge in millimetres."""
        return min(self.width, self.height)

    @property
    def tempo(self) -> float:
        """The factor on the speed of taps, which people hurry less than movements."""
        return math.sqrt(SPEEDS[self.speed])

    def reach(self) -> float:
        """The size of this movement, 0..1, from habit and chance."""
        return float(np.clip(self.person.reach + self.rng.normal(0.0, 0.22), 0.0, 1.0))

    def spot(self, half_width: float, half_height: float, beyond: float = 0.05) -> tuple[float, float]:
        """The centre (x, y in mm) of something of that half size; in a share `beyond` of cases it exceeds the edge."""
        rng, (px, py), spread = self.rng, self.person.place, self.person.place_spread
        slack = 0.09 if rng.random() < beyond else -0.04
        out = []
        for extent, half, habit in ((self.width, half_width, px), (self.height, half_height, py)):
            room = max(extent * (0.5 + slack) - half, 0.0)
            # A third of the places are anywhere; the others are near this person's preferred place.
            offset = rng.uniform(-room, room) if rng.random() < 0.35 else (habit + rng.normal(0.0, spread)) * extent / 2
            out.append(extent / 2 + float(np.clip(offset, -room, room)))
        return out[0], out[1]

    def settle(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Move a path (n,), in mm from any origin, to a place on the pad; a path that is too large is shrunk."""
        x, y = x - (x.min() + x.max()) / 2, y - (y.min() + y.max()) / 2
        hx, hy = max(float(x.max()), 0.1), max(float(y.max()), 0.1)
        scale = min(1.0, 0.47 * self.width / hx, 0.47 * self.height / hy)
        cx, cy = self.spot(hx * scale, hy * scale)
        return x * scale + cx, y * scale + cy

    def finger(
        self,
        t: Array,
        x: Array,
        y: Array,
        *,
        force: float = 1.0,
        size: float = 1.0,
        start: float = 0.0,
        fade_in_s: float | None = None,
        fade_out_s: float | None = None,
    ) -> Press:
        """This person's finger on the path x, y (n,) in mm at times t (n,) in s from 0, with tremor."""
        rng, person = self.rng, self.person
        level = force * self.press * person.force * float(np.clip(rng.lognormal(0.0, person.force_spread), 0.35, 2.5))
        fade_in = rng.uniform(0.02, 0.08) if fade_in_s is None else fade_in_s
        fade_out = rng.uniform(0.02, 0.09) if fade_out_s is None else fade_out_s
        shake = person.tremor_mm * float(rng.uniform(0.5, 1.5))
        # In a few cases the thumb or the side of the finger touches.
        broad = float(rng.uniform(1.2, 1.6)) if rng.random() < 0.08 else 1.0
        width = min(person.finger_mm * size * broad * float(rng.uniform(0.88, 1.14)), 8.0)
        oblong = float(np.clip(person.oblong * rng.uniform(0.85, 1.2), 1.0, 2.2))
        return Press(
            t=t + start,
            x=x + shake * wander(t, rng, 8.0, 12.0, 3),
            y=y + shake * wander(t, rng, 8.0, 12.0, 3),
            force=level * course(rng, t, fade_in, fade_out),
            length=width * math.sqrt(oblong),
            width=width / math.sqrt(oblong),
            angle=person.finger_angle + float(rng.normal(0.0, 0.25)),
            growth=person.growth,
            flatness=float(rng.uniform(0.85, 1.9)),
        )

    def tap_s(self) -> float:
        """The duration of one tap in seconds, 0.04 to 0.45 (median of real ones on a touchscreen: 0.2)."""
        return float(np.clip(self.person.tap_s * self.rng.lognormal(0.0, 0.22) / self.tempo, 0.04, 0.45))

    def gap_s(self) -> float:
        """The pause between two taps in seconds, 0.08 to 0.42."""
        return float(np.clip(self.person.gap_s * self.rng.lognormal(0.0, 0.2) / self.tempo, 0.08, 0.42))

    def spacing(self) -> float:
        """The distance of two fingertips in mm: 0.16 to 0.55 of the pad's shorter edge (1.5 to 5 of nine taxels)."""
        free = self.rng.uniform(0.16, 0.55) * self.small
        own = self.person.spacing_mm * float(self.rng.lognormal(0.0, 0.15))
        mix = own if self.rng.random() < 0.7 else free
        return float(np.clip(mix, max(0.16 * self.small, 9.0), max(0.55 * self.small, 12.0)))

    def rests(self) -> tuple[float, float]:
        """Seconds at rest before and after a stroke: often none, at most 0.43 before and 1.1 after."""
        rng, person, hurry = self.rng, self.person, math.sqrt(self.rate)
        before = rng.uniform(0.02, 0.3) * person.rest_start if rng.random() < 0.15 + 0.6 * person.rest_start else 0.0
        after = 0.6 * rng.beta(1.5, 1.8) if rng.random() < 0.1 + 0.8 * person.rest_end else 0.0
        if rng.random() < 0.15 * person.rest_end:
            after += rng.uniform(0.0, 0.5)
        return before / max(hurry, 0.7), min(after / max(hurry, 0.7), 1.1)


Made = list[Press] | list[Artefact]
Maker = Callable[[Occasion], Made]  # makes one kind of thing that a person does
M = TypeVar("M")


def named(*makers: M) -> dict[str, M]:
    """Makers by name; a maker's function has the name of the kind that it makes."""
    return {maker.__name__: maker for maker in makers}  # type: ignore[attr-defined]


def course(rng: np.random.Generator, t: Array, fade_in_s: float, fade_out_s: float) -> Array:
    """The force over a contact (n,), 0 at both ends: a rise, an uneven plateau about 1, and a fall.

    The plateau has an overshoot at landing, a slow rise or fall, a dome or a dip, or none of these.
    """
    total = float(t[-1])
    up = min(fade_in_s, 0.45 * total)
    down = min(fade_out_s, 0.5 * total)
    rise = 0.5 - 0.5 * np.cos(math.pi * np.clip(t / up, 0.0, 1.0))
    fall = 0.5 - 0.5 * np.cos(math.pi * np.clip((total - t) / down, 0.0, 1.0))
    u = t / total
    form = rng.random()
    if form < 0.3:
        shape = 1.0 + rng.uniform(0.1, 0.9) * np.exp(-t / rng.uniform(0.04, 0.2))
    elif form < 0.5:
        shape = 1.0 + rng.uniform(-0.45, 0.7) * (u - 0.5)
    elif form < 0.65:
        shape = 1.0 + rng.uniform(-0.4, 0.5) * np.sin(math.pi * u)
    else:
        shape = np.ones_like(t)
    uneven = rng.uniform(0.0, 0.16) * wander(t, rng, 0.3, 4.0) + 0.015 * wander(t, rng, 7.0, 12.0, 2)
    return np.maximum(rise * fall * shape * np.clip(1.0 + uneven, 0.3, 2.0), 0.0)
