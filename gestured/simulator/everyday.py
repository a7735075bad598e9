"""Everyday life on a sensor as a process in time: what rests, shifts, brushes and lies about, and what is meant.

A day is drawn for a place and a person. Postures follow one another, each for a while: an arm, an elbow, a hand, a body
that leans, a thing that lies there, nobody. Whatever rests breathes, is re-seated now and then, and is shaken by the
road. Beside that, things happen at rates an hour: sleeves, wiping, bumps, things put down, fingers that play. Gestures
are meant at known times: after quiet, soon after something has left, or beside what rests and does not cover them.

`POSTURES`, `PLACES` and `FINGERS` are one table: each number has its source, or is assumed. Whoever changes one prints
the figures with both.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from gestured.simulator.cohort import GESTURES, NONE, perform, performed
from gestured.simulator.gestures import one_tap
from gestured.simulator.kinematics import Array, wander
from gestured.simulator.occasion import Occasion
from gestured.simulator.people import Participant, Performance, Press, any_speed, generator
from gestured.simulator.sensor import Act, SimulatedSensor, Take
from gestured.simulator.strokes import touch_down

STEP_S = 0.04  # time grid of what rests: nothing in it is faster than the road
BREATH_HZ = 0.25  # an adult at rest
ROAD_HZ = (1.0, 12.0)  # a body on a seat passes on no more of a road's spectrum (ISO 8608 falls with the square)
RESEAT_S = 9.0  # between two shifts of what rests; assumed
TAP_S = 0.3  # what is longer is no tap, whatever was meant (99.7 % of intended touches: Matero and Colley, DIS 2012)
TAP_TRAVEL = 0.15  # of the pad's shorter side
APART_S = 0.3  # a gesture that is meant keeps so far from the next thing that the same hand does
COVERS = 1.6  # standard deviations around the middle of what rests: nobody aims a gesture at a place under an arm
AIMS = 6  # places that a person looks for beside what rests, before the gesture is given up; assumed
FREE_S = (3.0, 6.0)  # a sensor is switched on before somebody lies on it; what is learned with a hand is no idle sensor
SOON = 0.12  # share of all that leaves after which a gesture is meant within a second; assumed


@dataclass(frozen=True)
class Posture:
    """Something that rests: for how long, and what it presses with."""

    dwell_s: float  # median; lognormal
    force: tuple[float, float]  # in normal touches
    size: tuple[float, float]  # of the pad's shorter side: length and width, one standard deviation


NOBODY, HAND, THING = "nobody", "hand", "thing"
# Dwell times are assumed, but for the armrest's and the door's: forearm laid on, elbow while steering, and pushing off
# are the three postures that were measured on door armrests (SAE 2007-01-1217).
POSTURES: Mapping[str, Posture] = {
    NOBODY: Posture(25.0, (0.0, 0.0), (0.0, 0.0)),
    "forearm": Posture(40.0, (1.5, 7.0), (0.5, 0.16)),
    "elbow": Posture(20.0, (2.0, 9.0), (0.18, 0.14)),
    "push_off": Posture(1.2, (4.0, 12.0), (0.25, 0.2)),
    HAND: Posture(18.0, (0.8, 3.0), (0.26, 0.17)),
    "body": Posture(90.0, (1.0, 4.0), (0.6, 0.45)),
    THING: Posture(60.0, (0.5, 3.0), (0.16, 0.1)),
}


@dataclass(frozen=True)
class Place:
    """Where a sensor is: its postures by share, what happens beside them an hour, and how the road shakes it."""

    postures: Mapping[str, float]
    rates: Mapping[str, float]  # happenings an hour; all assumed
    road: float  # of the force, one standard deviation
    meant: float  # gestures an hour


PLACES: Mapping[str, Place] = {
    "armrest": Place(
        {NOBODY: 3.0, "forearm": 3.0, "elbow": 1.5, HAND: 1.5, "push_off": 0.5},
        {"sleeve_brush": 30.0, "wipe": 2.0, "bump": 25.0, "object_put_down": 3.0, "wrinkle": 3.0, "idle_tap": 8.0},
        0.06,
        45.0,
    ),
    "door": Place(
        {NOBODY: 4.0, "elbow": 3.0, "forearm": 2.0, "push_off": 1.0, HAND: 1.0},
        {"sleeve_brush": 30.0, "bump": 30.0, "wipe": 2.0, "palm": 6.0, "idle_tap": 8.0},
        0.09,
        45.0,
    ),
    "seat": Place(
        {"body": 6.0, NOBODY: 1.0, HAND: 0.5, THING: 1.0},
        {"bump": 25.0, "wrinkle": 25.0, "sleeve_brush": 6.0, "wipe": 3.0, "idle_tap": 4.0},
        0.12,
        20.0,
    ),
    "skin": Place(
        {NOBODY: 6.0, HAND: 1.5, "body": 0.5},
        {"bump": 25.0, "palm": 10.0, "sleeve_brush": 15.0, "wipe": 5.0, "object_put_down": 3.0, "idle_tap": 12.0},
        0.02,
        90.0,
    ),
    "table": Place(
        {NOBODY: 4.0, "forearm": 2.0, HAND: 2.0, THING: 3.0},
        {"object_put_down": 25.0, "wipe": 6.0, "sleeve_brush": 20.0, "bump": 10.0, "rubbing": 4.0, "idle_tap": 12.0},
        0.0,
        60.0,
    ),
}
# What the fingers of a hand that rests do, an hour of such rest; assumed.
FINGERS: Mapping[str, float] = {
    "idle_tap": 240.0,
    "drumming": 60.0,
    "rubbing": 60.0,
    "slow_touch": 30.0,
    "scribble": 6.0,
}


@dataclass(frozen=True)
class Day:
    """What a sensor sent for a while, and what really happened; `take.events` are in the order of their onsets."""

    place: str
    person: int
    take: Take
    contacts: int  # that nobody meant
    meant: tuple[tuple[Act, str], ...]  # gestures, each with what lay on the sensor (`NOTHING`, `LEFT` or a posture)
    like: tuple[Act, ...]  # contacts that are a tap in truth, though nobody meant one


NOTHING, LEFT = "nothing", "just left"


def day(seed: int, place: str, seconds: float, sensor: SimulatedSensor | None = None) -> Day:
    """So many seconds of everyday life at a place; the same for the same seed. Raises KeyError for an unknown place."""
    plan = planned(seed, place, seconds, sensor)
    everything = sorted([*plan.life, *((at, made) for at, made, _ in plan.meant)], key=lambda one: one[0])
    take = plan.of.sensor.record(everything, seconds, plan.of.rng)
    alone = [_truth(start, one) for start, one in plan.life if _like_a_tap(start, one, everything, plan.of.sensor)]
    contacts = sum(len(one.contacts) for _, one in plan.life)
    meant = tuple((_truth(at, one), lay) for at, one, lay in plan.meant)
    return Day(place, plan.of.person.seed, take, contacts, meant, tuple(alone))


def planned(seed: int, place: str, seconds: float, sensor: SimulatedSensor | None = None) -> "Plan":
    """What happens in `day`, before any sensor sees it: a fraction of its work. Raises KeyError as `day` does."""
    where, rng = PLACES[place], generator(seed, 0xDA1, *map(ord, place))
    person = Participant(int(rng.integers(1 << 40)) + 2_000_000)
    lived = _Life(where, person, sensor or SimulatedSensor.nominal(day=person.seed), rng, seconds)
    life = [one for one in lived.unmeant() if one[0] < seconds]
    return Plan(lived, life, list(lived.meant(life)))


Happening = tuple[float, Performance]  # when it begins (s), and what it is


@dataclass(frozen=True)
class _Life:
    """One person at one place for a while."""

    where: Place
    person: Participant
    sensor: SimulatedSensor
    rng: np.random.Generator
    seconds: float

    def unmeant(self) -> Iterator[Happening]:
        """What nobody means: postures one after the other, and what happens beside them."""
        names, now = list(self.where.postures), float(self.rng.uniform(*FREE_S))
        chances = np.array([self.where.postures[name] for name in names])
        while now < self.seconds:
            name = names[int(self.rng.choice(len(names), p=chances / chances.sum()))]
            dwell = float(np.clip(POSTURES[name].dwell_s * self.rng.lognormal(0.0, 0.7), 0.5, 900.0))
            if name != NOBODY:
                yield now, self._rest(name, dwell)
            if name == HAND:
                for kind, rate in FINGERS.items():
                    yield from ((now + at, self._happen(kind)) for at in self._times(rate, dwell))
            now += dwell + float(self.rng.uniform(0.3, 3.0))
        for kind, rate in self.where.rates.items():
            yield from ((at, self._happen(kind)) for at in self._times(rate, self.seconds))

    def meant(self, life: list[Happening]) -> Iterator[tuple[float, Performance, str]]:
        """Gestures that somebody means with a free hand, each with what lay on the sensor.

        Nothing else that moves is in their time, and nothing that rests covers their way.
        """
        resting = [(at, at + one.duration_s, one) for at, one in life if one.kind in POSTURES]
        moving = [(at, at + one.duration_s) for at, one in life if one.kind not in POSTURES]
        soon = [end + float(self.rng.uniform(0.1, 1.0)) for _, end, _ in resting if self.rng.random() < SOON]
        last = 2.0
        for at in sorted([*self._times(self.where.meant, self.seconds), *soon]):
            under = [one for a, b, one in resting if a - APART_S < at < b + 0.05]
            made = self._beside(under)
            if made is None:
                continue
            begin, end = at - APART_S, at + made.duration_s + APART_S
            changes = any(begin < a < end or at < b < end for a, b, _ in resting)
            if (
                begin > last
                and end < self.seconds
                and not changes
                and not any(a < end and b > begin for a, b in moving)
            ):
                last = end
                left = any(b < at <= b + 1.0 for _, b, _ in resting)
                yield at, made, under[0].kind if under else LEFT if left else NOTHING

    def _beside(self, under: list[Performance]) -> Performance | None:
        """A gesture whose way nothing that rests covers; None where this person finds no place for one."""
        kind = GESTURES[int(self.rng.integers(len(GESTURES)))]
        for _ in range(AIMS):
            speed, inclination = any_speed(self.rng), int(self.rng.integers(3))
            made = perform(kind, self.person, self.rng, speed, inclination, self.sensor.extent)
            if not any(_covers(one.contacts[0], press) for one in under for press in made.contacts):
                return made
        return None

    def _times(self, rate: float, seconds: float) -> list[float]:
        """Moments of a Poisson process of so many an hour, in order."""
        count = int(self.rng.poisson(rate * seconds / 3600.0))
        return [float(at) for at in np.sort(self.rng.uniform(0.0, seconds, count))]

    def _happen(self, kind: str) -> Performance:
        """One short thing."""
        speed, inclination = any_speed(self.rng), int(self.rng.integers(3))
        own = {"bump": _bump, "idle_tap": one_tap}
        if kind in own:
            return performed(kind, own[kind], self.person, self.rng, speed, inclination, self.sensor.extent)
        return perform(kind, self.person, self.rng, speed, inclination, self.sensor.extent)

    def _rest(self, name: str, seconds: float) -> Performance:
        """Something that rests for a while: it lands, breathes, is re-seated, is shaken, and leaves."""
        posture, (width, height) = POSTURES[name], self.sensor.extent
        small = min(width, height)
        t = np.linspace(0.0, seconds, max(8, math.ceil(seconds / STEP_S) + 1))
        still = name == THING
        shifts = 0.0 if still else 1.0
        ways = [shifts * _reseated(t, self.rng) for _ in range(3)]
        breath = 0.0 if still else float(self.rng.uniform(0.01, 0.06))
        shake = (
            1.0
            + breath * np.sin(2 * math.pi * (BREATH_HZ * t + self.rng.random()))
            + self.where.road * wander(t, self.rng, *ROAD_HZ, 8)
        )
        level = float(self.rng.uniform(*posture.force)) * self.person.force
        land, leave = (float(self.rng.uniform(0.05, 0.5)) for _ in range(2))
        edge = np.clip(t / min(land, 0.4 * seconds), 0.0, 1.0) * np.clip(
            (seconds - t) / min(leave, 0.4 * seconds), 0.0, 1.0
        )
        force = np.maximum(level * edge * shake * np.exp(0.25 * ways[2]), 0.0)
        x = width * float(self.rng.uniform(0.15, 0.85)) + 0.08 * small * ways[0]
        y = height * float(self.rng.uniform(0.15, 0.85)) + 0.08 * small * ways[1]
        length, across = (small * side * float(self.rng.uniform(0.75, 1.3)) for side in posture.size)
        press = Press(t, x, y, force, length, across, float(self.rng.uniform(0.0, math.pi)), 0.1, 1.3, False)
        return Performance(name, NONE, (press,), seconds, "normal", int(self.rng.integers(3)), self.person.seed)


def _bump(occasion: Occasion) -> list[Press]:
    """A knee, an elbow or a bag meets the pad for a moment: larger than a fingertip, with no aim."""
    rng = occasion.rng
    x, y = occasion.spot(2.0, 2.0, beyond=0.3)
    press = touch_down(occasion, x, y, float(rng.uniform(0.05, 0.5)), 0.0, float(rng.uniform(0.3, 2.5)))
    length, width = sorted(rng.uniform(5.0, 22.0, 2))
    return [replace(press, length=float(width), width=float(length), finger=False)]


def _reseated(t: Array, rng: np.random.Generator) -> Array:
    """A value (n,) that is put anew every few seconds, within a third of a second each time."""
    moments = np.sort(rng.uniform(0.0, t[-1], int(rng.poisson(t[-1] / RESEAT_S))))
    way = np.zeros_like(t)
    for moment, step in zip(moments, rng.normal(0.0, 1.0, moments.size), strict=True):
        way += step * np.clip((t - moment) / 0.33, 0.0, 1.0)
    return np.asarray(np.tanh(way))


@dataclass(frozen=True)
class Plan:
    """What happens on a day: what nobody means, and what somebody does, each gesture with what lies on the sensor."""

    of: _Life
    life: list[Happening]
    meant: list[tuple[float, Performance, str]]


def _covers(rest: Press, press: Press) -> bool:
    """Whether any of a finger's way lies under what rests: within `COVERS` standard deviations of its middle."""
    dx, dy = press.x - float(np.median(rest.x)), press.y - float(np.median(rest.y))
    c, s = math.cos(rest.angle), math.sin(rest.angle)
    far = np.hypot((dx * c + dy * s) / (rest.length + press.length), (dy * c - dx * s) / (rest.width + press.width))
    return bool((far < COVERS).any())


def _truth(start: float, one: Performance) -> Act:
    return Act(one.label, one.kind, start, start + one.duration_s, one.speed, one.inclination, one.participant)


def _like_a_tap(start: float, one: Performance, everything: list[Happening], sensor: SimulatedSensor) -> bool:
    """Whether a contact is a tap in truth: one finger, 0.3 s at most, within a tap's travel, nothing else touched."""
    if len(one.contacts) != 1 or not one.contacts[0].finger or one.duration_s > TAP_S:
        return False
    way = math.hypot(np.ptp(one.contacts[0].x), np.ptp(one.contacts[0].y))
    others = (other for other in everything if other[1] is not one)
    return way <= TAP_TRAVEL * min(sensor.extent) and not any(
        at < start + one.duration_s + TAP_S and at + other.duration_s > start - TAP_S for at, other in others
    )
