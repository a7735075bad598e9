"""Everyday life of the independent generator: half hours of ordinary contact, and gestures meant in between.

One person at one place makes contacts at random: each kind has a rate, which differs between people, and some kinds
come in bouts. What lies on the sheet (an arm, a hand, a thing) breathes, wanders, is re-seated and shaken by the road
until it leaves. All this was conceived without looking at the simulator's own everyday life. No model is trained or
tuned on it, and a rate in RATES is never changed to make a figure better.
"""

import heapq
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from experiments.foreign import hands
from experiments.foreign.hands import (
    GESTURES,
    LEVELS,
    STEP_S,
    Array,
    Pad,
    Performance,
    Person,
    Rng,
    draw_person,
    perform,
)  # fmt: skip
from experiments.foreign.sensors import draw_sensor, record
from gestured.record.judge import NONE, Performed

PLACES = ("armrest", "door", "seat", "robot", "table")
LENGTH_S = 1800.0
RATES: dict[str, tuple[tuple[float, ...], float, str]] = {  # an hour at each of PLACES; mean size of a bout; source
    "gesture": ((90, 90, 90, 90, 90), 1.0, "issue 22: about 90"),
    "rest": ((15, 17, 8, 9, 16), 1.0, "arm on the rest 34 % of the time, Viano et al. 1989, with STAYS below"),
    "shift": ((60, 50, 70, 30, 50), 1.0, "an hour of lying; about one a minute, assumed"),
    "lift": ((23, 23, 4, 6, 23), 1.0, "an hour of lying; hands go to the face 23 times an hour, Kwok et al. 2015"),
    "play": ((12, 7, 3, 5, 14), 1.5, "a hand lies and a finger plays; assumed"),
    "drum": ((8, 9, 2, 3, 10), 2.0, "assumed; its pace 0.6 s, McAuley et al. 2006"),
    "rub": ((16, 12, 12, 12, 12), 1.5, "assumed"),
    "trail": ((9, 9, 8, 16, 16), 1.5, "assumed"),
    "poke": ((8, 8, 6, 14, 14), 1.3, "assumed"),
    "hold": ((4, 5, 4, 8, 5), 1.0, "a finger stays; assumed"),
    "graze": ((24, 28, 24, 26, 32), 1.3, "assumed"),
    "sleeve": ((26, 26, 16, 12, 26), 1.3, "assumed"),
    "cloth": ((5, 5, 10, 4, 4), 1.0, "a jacket, a blanket, a bag's strap; assumed"),
    "bump": ((10, 18, 14, 16, 8), 1.2, "elbows, knees, hips; assumed"),
    "pat": ((3, 3, 10, 14, 6), 1.0, "a flat hand, a child's too; assumed"),
    "push": ((6, 9, 8, 6, 5), 1.0, "pushing off is a posture at a door, SAE 2007-01-1217; how often, assumed"),
    "lean": ((7, 8, 14, 10, 9), 1.0, "assumed"),
    "grip": ((5, 12, 5, 18, 2), 1.0, "assumed"),
    "thing": ((9, 4, 8, 3, 24), 1.0, "put down, and taken away after STAYS; assumed"),
    "slide": ((4, 2, 4, 2, 16), 1.0, "a thing pushed or drawn over; assumed"),
    "wipe": ((2, 3, 3, 4, 6), 1.0, "assumed"),
}
WHILE_LYING = ("shift", "lift")
STAYS = {"armrest": 55.0, "door": 48.0, "seat": 110.0, "robot": 8.0, "table": 45.0, "thing": 22.0}  # s, median; assumed
POSTURES = {  # those at a door are from SAE 2007-01-1217; the shares are assumed
    "armrest": {"forearm": 0.5, "elbow": 0.15, "wrist": 0.2, "hand": 0.15},
    "door": {"forearm": 0.4, "elbow": 0.45, "wrist": 0.1, "hand": 0.05},
    "seat": {"thigh": 0.8, "elbow": 0.05, "hand": 0.15},
    "robot": {"forearm": 0.3, "elbow": 0.05, "wrist": 0.15, "hand": 0.5},
    "table": {"forearm": 0.45, "elbow": 0.15, "wrist": 0.25, "hand": 0.15},
}
Span = tuple[float, float]
# Broad contacts that touch once; all assumed. Number of pieces, points of each, sigma along (from, to) and across,
# distance of the pieces, length of the way (all in taxels), force (a finger's usual presses), duration and rise (s).
PATCHES: dict[str, tuple[tuple[int, int], int, Span, float, float, Span, Span, Span, float]] = {
    "graze": ((1, 4), 14, (0.3, 1.3), 0.3, 1.3, (1.0, 7.0), (0.2, 1.2), (0.07, 0.45), 0.05),
    "cloth": ((3, 7), 16, (0.8, 2.0), 0.3, 2.5, (0.3, 1.5), (0.1, 0.7), (1.0, 14.0), 0.3),
    "bump": ((1, 1), 28, (0.4, 1.2), 0.6, 0.0, (0.0, 1.2), (1.0, 7.0), (0.05, 0.3), 0.06),
    "push": ((1, 2), 28, (0.8, 1.6), 0.8, 2.0, (0.0, 1.0), (4.0, 15.0), (0.3, 1.8), 0.15),
    "lean": ((1, 1), 36, (1.0, 2.5), 1.1, 0.0, (0.2, 1.5), (4.0, 20.0), (0.8, 12.0), 0.4),
    "grip": ((3, 5), 25, (0.4, 1.0), 0.5, 2.3, (0.0, 0.6), (0.7, 4.0), (0.4, 6.0), 0.1),
    "slide": ((1, 1), 30, (0.6, 2.0), 0.8, 0.0, (3.0, 14.0), (1.0, 5.0), (0.25, 1.6), 0.1),
    "wipe": ((1, 1), 30, (0.8, 1.8), 0.8, 0.0, (5.0, 11.0), (1.0, 4.0), (0.25, 0.6), 0.1),
}
HABIT = 0.5  # sigma of the lognormal of mean 1 by which people differ in each rate; assumed
DRIVING = {"armrest": 0.7, "door": 0.7, "seat": 0.7}  # share of the time; assumed
ROUGH = np.array([16e-6, 64e-6, 256e-6])  # m^3, ISO 8608 classes A, B and C at 0.1 cycles a metre
TAP_S, TAP_TRAVEL = 0.3, 0.15 * 9  # s and taxels: a contact of one finger is a tap up to this duration and travel


@dataclass(frozen=True)
class Life:
    """Half an hour of one person: frames (N, 9, 9) raw counts at times (N,) s, and the truth.

    The kind of a meant gesture is its circumstance: `beside` something that lies there; `after`: within a second after
    something left; `middle`: within five; `quiet`: later than that. `taps` are contacts that nobody meant as gestures
    and that are taps all the same: one finger, short, in one place, and nothing else touches.
    """

    place: str
    frames: NDArray[np.generic]
    times: Array
    meant: list[Performed]
    contacts: list[Performed]
    taps: list[Performed]


@dataclass(eq=False)
class _Part:
    """A patch that lies on the sheet from `since` (s) until it is lifted."""

    kind: str
    since: float
    at: Array
    points: Array
    force: float


def _road(rng: Rng, share: float, length: float) -> tuple[Array, Array]:
    """Times (s) and vertical acceleration (m/s^2) of a car's body on roads of ISO 8608, with stops."""
    t = np.arange(0.0, length, 0.02)
    f = np.maximum(np.fft.rfftfreq(len(t), 0.02), 0.05)
    r = f / rng.uniform(1.1, 1.6)  # the body's natural frequency, Hz
    body = (1 + (0.6 * r) ** 2) / ((1 - r**2) ** 2 + (0.6 * r) ** 2) / (1 + (f / 12) ** 4)
    density = (2 * np.pi * f) ** 4 * 0.01 * rng.uniform(8.0, 33.0) / f**2 * body  # at 8 to 33 m/s, roughness 1 m^3
    shaken = np.fft.irfft(np.fft.rfft(rng.standard_normal(len(t))) * np.sqrt(density / 0.04), len(t))
    minutes = np.arange(0.0, length + 60.0, 60.0)
    moving = np.repeat(rng.random(len(minutes) // 4 + 1) < share, 4)[: len(minutes)]
    strength = np.interp(t, minutes, np.sqrt(rng.choice(ROUGH, len(minutes), p=[0.4, 0.45, 0.15])) * moving)
    shaken *= strength
    for at in np.flatnonzero((rng.random(len(t)) < 0.02 / 40) & (strength > 0)):  # a hole every 40 s; assumed
        ring = t[at : at + 75] - t[at]
        shaken[at : at + 75] += rng.uniform(1, 5) * np.exp(-ring / 0.25) * np.sin(2 * np.pi * rng.uniform(2, 6) * ring)
    return t, shaken


class _Story:
    """The course of one half hour; what was done is in `pads`, `touches`, `contacts` and `meant`."""

    def __init__(self, rng: Rng, place: str, level: str, length: float) -> None:
        self.rng, self.place, self.length = rng, place, length
        self.person, self.other = draw_person(rng, level), draw_person(rng, level)
        self.road = _road(rng, DRIVING.get(place, 0.0), length + 60)
        self.breath = 2 * np.pi * rng.uniform(0.2, 0.33)  # rad/s, as adults breathe at rest
        self.habits = {kind: float(np.exp(rng.normal(0, HABIT) - HABIT**2 / 2)) for kind in RATES} | {"gesture": 1.0}
        self.pads: list[Pad] = []
        self.touches: list[tuple[float, float, bool]] = []  # of each pad: onset and offset (s), whether it may be a tap
        self.contacts: list[Performed] = []
        self.meant: list[Performed] = []
        self.lying: list[_Part] = []
        self.agenda: list[tuple[float, str]] = []
        self.last = -9.0  # s, when something was last lifted
        self.pending = False  # a gesture follows the next contact
        for kind in RATES:
            if kind not in WHILE_LYING:
                self._plan(kind, 2.0, length)

    def live(self) -> None:
        """Work off the agenda; what lies on the sheet at the end stays."""
        clock = 2.0
        while self.agenda:
            at, kind = heapq.heappop(self.agenda)
            now = max(at, clock)
            if now > self.length - 30.0:
                break
            clock = self._do(kind, now, self.person if self.rng.random() < 0.85 else self.other)
            if self.pending and kind != "gesture":
                self.pending = False
                clock = (
                    self._gesture(clock + 1.0, self.person) if self.lying else self._mean(self.last + self._gap(0.6))
                )
            clock += min(0.25 + self.rng.exponential(0.9), 6.0)
        self._leave(self.length + 5.0, self.lying)

    def _plan(self, kind: str, start: float, end: float) -> None:
        """Put this person's contacts of a kind between two times (s) on the agenda, bout by bout."""
        rates, bout, _ = RATES[kind]
        rate = rates[PLACES.index(self.place)] * self.habits[kind] / bout
        for t in self.rng.uniform(start, end, self.rng.poisson(rate * (end - start) / 3600)):
            for n in range(int(self.rng.geometric(1 / bout))):
                heapq.heappush(self.agenda, (float(t) + 2.0 * n, kind))

    def _do(self, kind: str, now: float, hand: Person) -> float:
        """Do one thing from `now` on; returns when it is over (s)."""
        if kind in ("leave", "take"):
            return self._leave(now, [part for part in self.lying if (kind == "take") == (part.kind == "thing")])
        before = len(self.touches)
        if kind in PATCHES:
            end = self._patches(kind, now)
        elif kind in WHILE_LYING:
            end = self._again(kind, now)
        elif kind in ("hold", "sleeve"):
            done = perform("long_press" if kind == "hold" else kind, self.rng, hand)
            end = max(self._add(pad, now) for pad in done.pads)
        else:
            end = getattr(self, f"_{kind}")(now, hand)
        spans = [touch[:2] for touch in self.touches[before:]]
        if kind in ("drum", "pat"):
            self.contacts += [Performed(NONE, kind, *span) for span in spans]
        elif kind not in ("rest", "back", "thing", "play", "gesture", *WHILE_LYING):
            self._note(kind, min(spans)[0], max(span[1] for span in spans))
        return float(end)

    def _note(self, kind: str, onset: float, offset: float) -> None:
        self.contacts.append(Performed(NONE, kind, onset, offset))

    def _add(self, pad: Pad, start: float, *, finger: bool = False, loose: float = 0.6) -> float:
        """Let a pad touch from `start` on, shaken by the road as far as it is loose; returns when it lifts (s)."""
        t = pad.t + start
        g = loose * np.interp(t, *self.road) / 9.81
        force = pad.force * np.clip(1 + g, 0.0, 4.0)
        self.pads.append(replace(pad, t=t, force=force, x=pad.x + 0.6 * g, y=pad.y + 0.3 * g))
        small = finger and t[-1] - t[0] <= TAP_S and np.hypot(np.ptp(pad.x), np.ptp(pad.y)) <= TAP_TRAVEL
        self.touches.append((float(t[0]), float(t[-1]), bool(small)))
        self.last = max(self.last, float(t[-1]))
        return float(t[-1])

    def taps(self) -> list[Performed]:
        """The contacts that nobody meant as gestures, and that are taps all the same."""
        onsets, offsets = (np.array([touch[n] for touch in self.touches]) for n in (0, 1))
        return [
            Performed(NONE, "tap", on, off)
            for on, off, small in self.touches
            if small and ((onsets <= off) & (offsets >= on)).sum() == 1
        ]

    # Shapes and paths.

    def _gap(self, soon: float) -> float:
        """Seconds from the last contact to a gesture: below 1 with a probability of `soon`, else 1 to 5."""
        return float(self.rng.uniform(0.15, 1.0) if self.rng.random() < soon else self.rng.uniform(1.0, 5.0))

    def _cloud(self, count: int, along: float, across: float, angle: float) -> Array:
        """(count, 2) random points, normal with these sigmas (taxels) along an angle (rad) and across it."""
        u, v = self.rng.normal(0, along, count), self.rng.normal(0, across, count)
        return np.stack([u * np.cos(angle) - v * np.sin(angle), u * np.sin(angle) + v * np.cos(angle)], axis=1)

    def _way(self, length: float, legs: int = 1) -> Array:
        """A nearly straight path (N, 2) through a random spot, to and fro for so many `legs`."""
        a, spot = self.rng.uniform(0, 2 * np.pi), self.rng.uniform(-0.4, 8.4, 2)
        step = 0.5 * length * np.array([np.cos(a), np.sin(a)])
        way = np.stack([spot - step, spot + self.rng.normal(0, 0.06 * length, 2), spot + step])
        drift = self.rng.normal(0, 0.06 * length, 2)
        return np.concatenate([way[:: 1 - 2 * (n % 2)] + n * drift for n in range(legs)])

    def _patch(self, path: Array, points: Array, force: float, lasts: float, rise: float) -> Pad:
        """A patch that comes down, goes along a path (N, 2) at a wavering pace, and lifts."""
        t = np.arange(0.0, lasts + STEP_S, STEP_S)
        pace = np.interp(t / t[-1], np.linspace(0, 1, 6), np.sort(np.r_[0, self.rng.random(4), 1]))
        u, k = (0.5 * pace + 0.5 * t / t[-1]) * (len(path) - 1), np.arange(len(path))
        waver = np.clip(np.interp(t / t[-1], np.linspace(0, 1, 7), self.rng.normal(1, 0.2, 7)), 0.2, 2.0)
        rise = min(rise, 0.45 * lasts)
        pressed = force * waver * hands.ramp(t / rise) * hands.ramp((t[-1] - t) / rise)
        weights = self.rng.uniform(0.4, 1.0, len(points))
        x, y = (np.interp(u, k, path[:, i]) for i in (0, 1))
        return Pad(t, x, y, pressed, points, weights / weights.sum(), 0.4)

    def _patches(self, kind: str, now: float) -> float:
        """One contact of PATCHES, in one piece or several; returns when it is over (s)."""
        (least, most), count, wide, narrow, apart, length, force, lasts, rise = PATCHES[kind]
        draw, end, legs = self.rng.uniform, now, int(self.rng.integers(2, 9)) if kind == "wipe" else 1
        whole = legs * draw(*lasts)
        way, angle = self._way(draw(*length), legs), draw(0, np.pi)
        for n in range(int(self.rng.integers(least, most + 1))):
            points = self._cloud(count, draw(*wide), narrow, angle + 0.3 * self.rng.normal())
            path = way + min(n, 1) * self.rng.normal(0, apart, 2)
            pad = self._patch(path, points, draw(*force), whole * draw(0.8, 1), rise)
            end = max(end, self._add(pad, now + min(n, 1) * draw(0, 0.1)))
        return end

    # What lies on the sheet.

    def _leave(self, now: float, parts: list[_Part]) -> float:
        """Lift parts that have lain, each of them as pads of ten seconds; returns when they are gone (s)."""
        for part in list(parts):
            self.lying.remove(part)
            rise, fall, alive = *self.rng.uniform(0.08, 0.6, 2), float(part.kind != "thing")
            t = np.arange(part.since, max(now, part.since + rise) + fall, 0.02)
            knots = np.arange(part.since, t[-1] + 1.5, 1.5)
            wander = [np.interp(t, knots, self.rng.normal(0, 0.08 * alive, len(knots))) for _ in range(3)]
            swing = alive * np.sin(self.breath * t)
            force = (
                part.force
                * (1 + 0.03 * swing + wander[0])
                * hands.ramp((t - t[0]) / rise)
                * hands.ramp((t[-1] - t) / fall)
            )
            x, y = (part.at[i] + wander[i + 1] + 0.05 * swing for i in (0, 1))
            weights = self.rng.uniform(0.3, 1.0, len(part.points))
            for first in range(0, len(t) - 1, 500):
                some = slice(first, first + 501)
                pad = Pad(t[some], x[some], y[some], force[some], part.points, weights / weights.sum(), 0.35)
                self._add(pad, 0.0, loose=1.5)
        return max([now, self.last] if parts else [now])

    def _arm(self) -> list[_Part]:
        return [part for part in self.lying if part.kind != "thing"]

    def _posture(self, kind: str, now: float) -> None:
        """Lay down an arm, a hand or a thigh, from a random side."""
        draw, side = self.rng.uniform, int(self.rng.integers(4))
        names, shares = zip(*POSTURES[self.place].items(), strict=True)
        kind = kind or str(self.rng.choice(names, p=shares))
        at = np.array([draw(2.5, 5.5), draw(-0.3, 2.2 if kind in ("forearm", "elbow") else 1.2)])
        heel = np.concatenate([self._cloud(14, 0.6, 0.5, 0) + [s * draw(0.9, 1.6), 0] for s in (-1, 1)])
        shape, force = {
            "forearm": (self._cloud(40, 4.0, draw(0.5, 0.9), self.rng.normal(0, 0.12)), draw(4, 12)),
            "elbow": (self._cloud(28, draw(0.5, 1.0), 0.5, draw(0, np.pi)), draw(5, 14)),
            "thigh": (self._cloud(40, 4.0, draw(1.0, 1.5), self.rng.normal(0, 0.15)), draw(12, 30)),
        }.get(kind, (heel, draw(2, 6)))
        parts = [_Part(kind, now, at, shape, force)]
        for n in range(4 if kind == "hand" else 0):
            tip = at + [(n - 1.5) * 1.5, 4.2 - 0.4 * abs(n - 1.5)] + self.rng.normal(0, 0.2, 2)
            parts.append(_Part("finger", now + 0.05, tip, hands.fingertip(self.rng, self.person)[0], draw(0.15, 0.7)))
        turn = np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), side)
        self.lying += [replace(part, at=turn @ (part.at - 4) + 4, points=part.points @ turn.T) for part in parts]

    def _back(self, now: float, hand: Person) -> float:
        """Lay an arm that left for a gesture down again, unless it would have left for good by now."""
        if self._arm() or "leave" not in (kind for _, kind in self.agenda):
            return now
        self._posture("", now)
        self._note("back", now, now + 1.0)
        return now + 0.7

    def _rest(self, now: float, hand: Person, kind: str = "") -> float:
        now = self._leave(now, self._arm()) + float(self.rng.uniform(0.3, 1.5))
        self.agenda = [(at, each) for at, each in self.agenda if each not in ("leave", "back", *WHILE_LYING)]
        heapq.heapify(self.agenda)
        stay = STAYS[self.place] * float(np.exp(self.rng.normal(0, 0.9)))
        self._posture(kind, now)
        for each in WHILE_LYING:
            self._plan(each, now + 2.0, now + 2.0 + stay)
        heapq.heappush(self.agenda, (now + 2.0 + stay, "leave"))
        self._note("hand" if kind else "rest", now, now + 2.0 + stay)  # a hand is laid down to play
        return now + 0.7

    def _again(self, kind: str, now: float) -> float:
        """Lay the same arm a little elsewhere: shifted, perhaps without a gap, or after seconds in the air."""
        parts, step = self._arm(), self.rng.normal(0, 0.8, 2)
        gap = float(self.rng.choice([-0.3, -0.15, 0.1, 0.4]) if kind == "shift" else self.rng.uniform(1.0, 8.0))
        if not parts:
            return now
        since = max(self._leave(now, parts) + gap, now)
        for part in parts:
            points = part.points + self.rng.normal(0, 0.0 if part.kind == "finger" else 0.25, part.points.shape)
            force = part.force * self.rng.uniform(0.7, 1.4)
            self.lying.append(_Part(part.kind, since, np.clip(part.at + step, -0.5, 8.5), points, force))
        self._note(kind, since, since + 1.0)
        return since + 0.7

    def _thing(self, now: float, hand: Person) -> float:
        draw, a = self.rng.uniform, np.arange(32) * 2 * np.pi / 32
        shape, force = [
            (draw(1.2, 2.6) * np.stack([np.cos(a), np.sin(a)], axis=1), draw(1.5, 6.0)),  # a cup
            (draw(-0.5, 0.5, (40, 2)) * [7.0, 14.0], draw(1.0, 2.5)),  # a telephone, much of it beside the sensor
            (self._cloud(16, 3.0, 0.1, draw(0, np.pi)), draw(0.2, 0.8)),  # a pen, keys
            (draw(-0.5, 0.5, (40, 2)) * draw(2.0, 9.0, 2), draw(1.5, 8.0)),  # a box, a book
        ][int(self.rng.choice(4, p=[0.3, 0.35, 0.2, 0.15]))]
        stay = STAYS["thing"] * float(np.exp(self.rng.normal(0, 0.9)))
        self.lying.append(_Part("thing", now, draw(-1.0, 9.0, 2), shape, force))
        heapq.heappush(self.agenda, (now + stay, "take"))
        self._note("thing", now, now + stay)
        return now + 0.5

    # Movements of fingers.

    def _play(self, now: float, hand: Person) -> float:
        """A hand lies, and one of its fingers taps or strokes."""
        rng = self.rng
        if not any(part.kind == "finger" for part in self.lying):
            now = self._rest(now, hand, "hand") + float(rng.uniform(0.5, 3.0))
        part = [part for part in self.lying if part.kind == "finger"][int(rng.integers(4))]
        now = self._leave(now, [part]) + 0.1
        for _ in range(int(rng.integers(1, 8))):
            at = part.at + rng.normal(0, 0.3, 2)
            pad = hands.press(rng, hand, at, float(rng.uniform(0.06, 0.3)), 0.1)
            if rng.random() < 0.25:
                way = at + np.stack([np.zeros(2), rng.normal(0, 1.0, 2), rng.normal(0, 1.5, 2)])
                pad = hands.stroke(rng, hand, hands.spline(way), float(rng.uniform(0.2, 0.8)))
            end = self._add(pad, now, finger=True)
            self._note("play", now, end)
            now = end + float(rng.uniform(0.08, 0.8))
        self.lying.append(replace(part, since=now))
        return now + 0.3

    def _drum(self, now: float, hand: Person) -> float:
        """Fingers of a hand that hovers: rolls from the little finger on, or one finger that beats time."""
        rng, end, at = self.rng, now, self.rng.uniform(1.5, 6.5, 2)
        side = rng.uniform(1.3, 2.0) * np.array([np.cos(a := rng.uniform(0, 2 * np.pi)), np.sin(a)])
        count, pace = int(rng.choice([1, 3, 4])), float(np.clip(0.6 * np.exp(rng.normal(0, 0.35)), 0.2, 1.2))
        for beat in range(int(rng.integers(2, 7))):
            for n in range(count):
                pad = hands.press(rng, hand, at + (n - (count - 1) / 2) * side, float(rng.uniform(0.05, 0.13)), 0.05)
                end = max(end, self._add(pad, now + (beat + n * rng.uniform(0.12, 0.2)) * pace, finger=True))
        return end

    def _rub(self, now: float, hand: Person) -> float:
        legs = int(self.rng.integers(2, 9))
        return self._fingers(self._way(self.rng.uniform(0.8, 3.5), legs), now, hand, legs * self.rng.uniform(0.14, 0.5))

    def _trail(self, now: float, hand: Person) -> float:
        """Fingers that follow an edge or a seam, slowly and lightly."""
        steps = self.rng.normal(0, 1.8, (int(self.rng.integers(3, 7)), 2))
        path = hands.spline(self.rng.uniform(0, 8, 2) + np.cumsum(steps, axis=0))
        return self._fingers(path, now, hand, self.rng.uniform(0.6, 4.0))

    def _fingers(self, path: Array, now: float, hand: Person, lasts: float) -> float:
        count, light, end = int(self.rng.choice([1, 2, 4], p=[0.6, 0.25, 0.15])), self.rng.uniform(0.35, 1.0), now
        side = self.rng.normal(0, 1, 2)
        for n in range(count):
            pad = hands.stroke(
                self.rng, hand, path + n * 1.6 * side / np.hypot(*side), lasts * self.rng.uniform(0.9, 1.0)
            )
            end = max(end, self._add(replace(pad, force=pad.force * light), now + 0.03 * n, finger=count == 1))
        return end

    def _poke(self, now: float, hand: Person) -> float:
        lasts = float(np.clip(0.22 * np.exp(self.rng.normal(0, 0.6)), 0.05, 1.5))
        pad = hands.press(self.rng, hand, self.rng.uniform(-0.4, 8.4, 2), lasts, 0.25)
        return self._add(replace(pad, force=pad.force * self.rng.uniform(0.4, 1.1)), now, finger=True)

    def _pat(self, now: float, hand: Person) -> float:
        points, spot = self._cloud(30, self.rng.uniform(0.9, 1.8), 1.0, 0.0), self.rng.uniform(1, 7, 2)
        for _ in range(int(self.rng.integers(1, 6))):
            way, lasts = spot + self.rng.normal(0, 0.4, (2, 2)), float(self.rng.uniform(0.08, 0.25))
            pad = self._patch(way, points, self.rng.uniform(1.5, 5), lasts, 0.05)
            now = self._add(pad, now) + float(self.rng.uniform(0.12, 0.45))
        return now

    # Meant gestures.

    def _gesture(self, now: float, hand: Person) -> float:
        """Make or plan a gesture: beside what lies there, after it, after the next contact, or when all is quiet."""
        if self.lying:
            if self._room() is not None and self.rng.random() < 0.7:
                return self._mean(max(now, self.last + 0.2))
            if self._arm():
                heapq.heappush(self.agenda, (now + float(self.rng.uniform(3.0, 12.0)), "back"))
            self._leave(now, self.lying)
            return self._mean(self.last + self._gap(0.75))
        if not self.pending and self.rng.random() < 0.5:
            self.pending = True
            return now
        return self._mean(max(now, self.last + 5.0 + self.rng.exponential(2.0)))

    def _room(self) -> tuple[Array, Array] | None:
        """The widest strip (low, high) of the sheet beside what lies there; None if it is too narrow."""
        spread = np.concatenate([part.at + part.points for part in self.lying])
        spread = spread[((spread > -0.6) & (spread < 8.6)).all(axis=1)]
        low, high = (spread.min(axis=0), spread.max(axis=0)) if len(spread) else (np.full(2, 9.0), np.full(2, 9.0))
        a, b = -0.4, 8.4
        strips = np.array([[a, a, low[0], b], [high[0], a, b, b], [a, a, b, low[1]], [a, high[1], b, b]])
        best = max(strips, key=lambda strip: float((strip[2:] - strip[:2]).min()))
        return (best[:2], best[2:]) if (best[2:] - best[:2]).min() > 4.2 else None

    def _mean(self, start: float) -> float:
        """Make a gesture and record its truth; returns when it is over (s)."""
        done, gap = perform(str(self.rng.choice(GESTURES)), self.rng, self.person), start - self.last
        how = "after" if gap <= 1.0 else "middle" if gap < 5.0 else "quiet"
        if self.lying and (room := self._room()):
            done, how = _fitted(done, *room), "beside"
        end = max(self._add(pad, start) for pad in done.pads)
        self.meant.append(Performed(done.kind, how, start, end))
        return end + 0.4


def _fitted(done: Performance, low: Array, high: Array) -> Performance:
    """The same movement between two corners, made smaller if it does not fit."""
    ways = [np.stack([pad.x, pad.y], axis=1) for pad in done.pads]
    least, most = np.concatenate(ways).min(axis=0), np.concatenate(ways).max(axis=0)
    room = high - low - 1.4
    scale = min(1.0, float((room / np.maximum(most - least, 1e-9)).min()))
    free = np.maximum((room - scale * (most - least)) / 2, 0.0)
    middle = (least + most) / 2
    target = (low + high) / 2 + np.clip(middle - (low + high) / 2, -free, free)
    moved = [target + scale * (way - middle) for way in ways]
    return replace(done, pads=tuple(replace(p, x=w[:, 0], y=w[:, 1]) for p, w in zip(done.pads, moved, strict=True)))


def story(seed: int, level: str = "nominal", length: float = LENGTH_S) -> _Story:
    """The story of the person with this seed at the seed's place, `length` s long."""
    told = _Story(np.random.default_rng([seed, 2027, LEVELS.index(level)]), PLACES[seed % len(PLACES)], level, length)
    told.live()
    return told


def live(seed: int, level: str = "nominal", length: float = LENGTH_S) -> Life:
    """`length` s of the person with this seed, at the seed's place and on a sensor of that person's own."""
    told = story(seed, level, length)
    rng, sensor = told.rng, draw_sensor(told.rng, level)
    # A sheet's drift is drawn for a minute. Over half an hour a cabin warms towards a limit, and a heater goes on and
    # off.
    share, pace, heater = rng.uniform(-1, 1), rng.uniform(240.0, 1200.0), rng.uniform(120.0, 600.0)
    sensor = replace(sensor, drift=sensor.counts * share * (0.05 if level == "hard" else 0.02))  # assumed
    all_of_it = Performance("life", tuple(told.pads), length)
    frames, times, _ = record(
        sensor, rng, [(0.0, all_of_it)], length, lambda t: -np.expm1(-t / pace) + 0.1 * np.sin(2 * np.pi * t / heater)
    )
    return Life(told.place, frames, times, told.meant, told.contacts, told.taps())
