"""Building blocks of performances: where on the pad, which stroke, how many fingers."""

import math
from dataclasses import dataclass

import numpy as np

from gestured.simulator.kinematics import Array, arc, grid, stroke_progress, wander
from gestured.simulator.people import SPEEDS, Participant, Press, fingertip


@dataclass(frozen=True, slots=True)
class Occasion:
    """One person about to do one thing on a pad of `width` x `height` millimetres."""

    rng: np.random.Generator
    person: Participant
    width: float
    height: float
    speed: str
    rate: float  # factor on speeds, of this movement
    turn: float  # radians: pose and habit
    grow: float  # factor on lengths from the pose
    press: float  # factor on forces from the pose

    @property
    def small(self) -> float:
        """The pad's shorter edge in millimetres."""
        return min(self.width, self.height)

    @property
    def tempo(self) -> float:
        """Factor on taps' speed: people hurry less in tapping than in moving."""
        return math.sqrt(SPEEDS[self.speed])

    def reach(self) -> float:
        """Size of this movement, 0..1: habit and chance."""
        return float(np.clip(self.person.reach + self.rng.normal(0.0, 0.22), 0.0, 1.0))

    def spot(self, half_width: float, half_height: float, beyond: float = 0.05) -> tuple[float, float]:
        """Centre for something of that half size; in a share `beyond` of cases partly over the edge."""
        rng, (px, py), spread = self.rng, self.person.place, self.person.place_spread
        slack = 0.09 if rng.random() < beyond else -0.04
        out = []
        for extent, half, habit in ((self.width, half_width, px), (self.height, half_height, py)):
            room = max(extent * (0.5 + slack) - half, 0.0)
            # A third of the places are anywhere; the rest cluster where this person likes to be.
            offset = rng.uniform(-room, room) if rng.random() < 0.35 else (habit + rng.normal(0.0, spread)) * extent / 2
            out.append(extent / 2 + float(np.clip(offset, -room, room)))
        return out[0], out[1]

    def settle(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Moves a path (n,) given anywhere to a place on the pad; one that is too large is shrunk to fit."""
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
        """This person's finger on a path, pressed as the pose has it."""
        return fingertip(
            self.rng,
            self.person,
            t,
            x,
            y,
            force=force * self.press,
            fade_in_s=fade_in_s,
            fade_out_s=fade_out_s,
            size=size,
            start=start,
        )

    def tap_s(self) -> float:
        """Duration of one tap in seconds, 0.04 to 0.45 (real ones on a touchscreen: median 0.2)."""
        return float(np.clip(self.person.tap_s * self.rng.lognormal(0.0, 0.22) / self.tempo, 0.04, 0.45))

    def gap_s(self) -> float:
        """Pause between two taps in seconds, 0.08 to 0.42."""
        return float(np.clip(self.person.gap_s * self.rng.lognormal(0.0, 0.2) / self.tempo, 0.08, 0.42))

    def spacing(self) -> float:
        """Distance of two fingertips: 0.16 to 0.55 of the pad's shorter edge (1.5 to 5 taxels of nine)."""
        free = self.rng.uniform(0.16, 0.55) * self.small
        own = self.person.spacing_mm * float(self.rng.lognormal(0.0, 0.15))
        mix = own if self.rng.random() < 0.7 else free
        return float(np.clip(mix, max(0.16 * self.small, 9.0), max(0.55 * self.small, 12.0)))

    def rests(self) -> tuple[float, float]:
        """Seconds at rest before and after a stroke: none, or up to 0.3 and 0.6, in a few cases 1.1."""
        rng, person, hurry = self.rng, self.person, math.sqrt(self.rate)
        before = rng.uniform(0.02, 0.3) * person.rest_start if rng.random() < 0.15 + 0.6 * person.rest_start else 0.0
        after = 0.6 * rng.beta(1.5, 1.8) if rng.random() < 0.1 + 0.8 * person.rest_end else 0.0
        if rng.random() < 0.15 * person.rest_end:
            after += rng.uniform(0.0, 0.5)
        return before / max(hurry, 0.7), min(after / max(hurry, 0.7), 1.1)


def touch_down(
    occasion: Occasion, x: float, y: float, duration_s: float, start: float = 0.0, force: float = 1.0
) -> Press:
    """A finger that stays where it lands for that long, rolling a little."""
    rng = occasion.rng
    t = grid(duration_s)
    # A fingertip rolls on and off and its centre moves with the load: some millimetres on a real panel.
    u = t / duration_s
    roll = np.multiply.outer(u - 0.5, np.clip(rng.normal(0.0, 1.9, 2), -4.5, 4.5))
    roll += np.multiply.outer(np.sin(math.pi * u), rng.normal(0.0, 0.8, 2))
    edge = 0.5 * duration_s
    return occasion.finger(
        t,
        x + roll[:, 0],
        y + roll[:, 1],
        force=force,
        start=start,
        fade_in_s=min(rng.uniform(0.015, 0.09), edge),
        fade_out_s=min(rng.uniform(0.02, 0.11), edge),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """A path relative to its centre on a time grid, and how the finger lands on it and leaves it."""

    t: Array
    x: Array
    y: Array
    fade_in_s: float
    fade_out_s: float


def stroke(occasion: Occasion, heading: float, length: float, *, limit: float = 0.36) -> Stroke:
    """One stroke of `length` millimetres towards `heading` (radians), within `limit` radians of it.

    Bent about wrist or elbow, unsteady, sometimes with a hook at the end, with rests or gliding on and off.
    Duration grows with length^0.4, as it does in free reaching.
    """
    rng, person = occasion.rng, occasion.person
    error = float(np.clip(occasion.turn + rng.normal(0.0, person.aim), -limit, limit))
    bend = float(np.clip(person.bend * length * rng.uniform(0.3, 1.6) + rng.normal(0.0, 0.06), -0.85, 0.85))
    move = float(np.clip(0.42 * (length / 50.0) ** 0.4 / occasion.rate * rng.lognormal(0.0, 0.15), 0.13, 1.6))
    before, after = occasion.rests()
    glides = before == 0.0 and after == 0.0 and rng.random() < 0.2 + 0.7 * person.glide
    t = grid(before + move + after)
    tau = (t - before) / move
    s = stroke_progress(tau, rng, moving_ends=float(rng.uniform(0.2, 1.0)) if glides else 0.0)
    x, y = arc(s, length, heading + error, bend)
    if rng.random() < 0.15:
        # A hook: the finger turns away or springs back as it stops.
        hook = rng.uniform(0.03, 0.11) * length
        away = heading + error + rng.choice([0.5, -0.5, 0.8, -0.8, 1.0]) * math.pi
        late = 0.5 + 0.5 * np.tanh((tau - 0.93) / 0.05)
        x, y = x + hook * late * math.cos(away), y + hook * late * math.sin(away)
    sway = person.wobble_mm * wander(t, rng, 0.4, 3.0, 3) * min(1.0, length / 30.0)
    x, y = x - sway * math.sin(heading), y + sway * math.cos(heading)
    half = 0.5 * length
    # A flick that also faded in and out would leave nothing between two frames.
    soft = min(1.0, move / 0.3)
    fade_in = soft * rng.uniform(0.05, 0.35) * move if glides else rng.uniform(0.02, 0.08)
    fade_out = soft * rng.uniform(0.05, 0.4) * move if glides else rng.uniform(0.02, 0.1)
    return Stroke(t, x - half * math.cos(heading), y - half * math.sin(heading), float(fade_in), float(fade_out))


def swipe_length(occasion: Occasion, heading: float) -> float:
    """Length of a swipe in millimetres: 0.2 to 0.95 of the pad's extent in that direction, 12 to 150 mm."""
    across = abs(math.cos(heading)) * occasion.width + abs(math.sin(heading)) * occasion.height
    across = min(across, 1.25 * occasion.small / max(abs(math.cos(heading)), abs(math.sin(heading)), 0.7) + 60.0)
    length = across * (0.21 + 0.72 * occasion.reach()) * occasion.grow
    return float(np.clip(length, max(12.0, 0.2 * across), min(150.0, 0.97 * across)))


def fingers_on(occasion: Occasion, path: Stroke, count: int, heading: float) -> list[Press]:
    """Several fingers side by side on one stroke: uneven in force, size, length, landing and lifting."""
    rng = occasion.rng
    if count == 1:
        x, y = occasion.settle(path.x, path.y)
        return [occasion.finger(path.t, x, y, fade_in_s=path.fade_in_s, fade_out_s=path.fade_out_s)]
    gap = min(occasion.spacing(), 0.8 * occasion.small / (count - 1))
    side = heading + math.pi / 2 + float(np.clip(rng.normal(0.0, 0.25), -0.6, 0.6))
    offsets = (np.arange(count) - (count - 1) / 2) * gap * rng.uniform(0.9, 1.1, count)
    xs = [path.x * rng.uniform(0.9, 1.08) + o * math.cos(side) for o in offsets]
    ys = [path.y * rng.uniform(0.9, 1.08) + o * math.sin(side) for o in offsets]
    all_x, all_y = occasion.settle(np.concatenate(xs), np.concatenate(ys))
    total = float(path.t[-1])
    delay_s = min(0.08, 0.25 * total)
    forces = rng.uniform(0.35, 1.0, count) if rng.random() < 0.3 else rng.uniform(0.7, 1.0, count)
    forces /= forces.max()
    contacts = []
    for k in range(count):
        first = rng.uniform(0.0, delay_s) if k else 0.0
        last = rng.uniform(0.0, delay_s)
        t = grid(total - first - last)
        n = path.t.size
        x = np.interp(t + first, path.t, all_x[k * n : (k + 1) * n])
        y = np.interp(t + first, path.t, all_y[k * n : (k + 1) * n])
        contacts.append(
            occasion.finger(
                t,
                x,
                y,
                force=float(forces[k]),
                size=float(rng.uniform(0.85, 1.12)),
                start=first,
                fade_in_s=path.fade_in_s,
                fade_out_s=path.fade_out_s,
            )
        )
    return contacts
