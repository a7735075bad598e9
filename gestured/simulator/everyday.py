"""Everyday life on a sensor as a process in time: what rests there, what else happens, and which gestures are meant.

A day is drawn for a place and a person. Postures follow one another, each for a while: an arm, an elbow, a hand, a body
that leans, a thing that lies there, nobody. Whatever rests breathes, shifts now and then, and is shaken by the road.
Beside that, things happen at hourly rates: sleeves, wiping, bumps, things put down, fingers that play. Gestures are
meant at known times: after quiet, soon after something has left, or beside something that rests.

`places` says what rests and happens at each place; `chance` does so with random patches in place of things.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from gestured.simulator.cohort import GESTURES, perform, performed
from gestured.simulator.occasion import Maker, Occasion
from gestured.simulator.people import Participant, Performance, Press, any_speed, generator
from gestured.simulator.places import FINGERS, Place
from gestured.simulator.resting import NOBODY
from gestured.simulator.sensor import Act, SimulatedSensor, Take
from gestured.simulator.unmeant import PLAYED, Places

TAP_S = 0.3  # a longer contact is no tap (99.7 % of intended touches are shorter: Matero and Colley, DIS 2012)
TAP_TRAVEL = 0.15  # of the pad's shorter side
APART_S = 0.3  # a meant gesture keeps so far in time from anything else that the same hand does
COVERS = 1.6  # standard deviations around the middle of what rests; nobody aims a gesture at a place under an arm
AIMS = 6  # places that a person tries beside what rests before the gesture is given up; assumed
FREE_S = (3.0, 6.0)  # nothing rests on the sensor at first, so that the idle sensor can be learned
SOON = 0.12  # share of departures after which a gesture is meant within a second; assumed
AFTER_WAKE_S = (0.8, 2.0)  # from the gesture that wakes a sensor to the one that is meant; assumed
HABIT = 0.6  # standard deviation of the logarithm of a person's own factor on each rate; assumed


@dataclass(frozen=True)
class Day:
    """A sensor's take of everyday life, and what really happened; `take.events` are in the order of their onsets."""

    place: str
    person: int
    take: Take
    contacts: int  # number of contacts that nobody meant
    meant: tuple[tuple[Act, str], ...]  # gestures, each with what lay on the sensor (`NOTHING`, `LEFT` or a posture)
    like: tuple[Act, ...]  # contacts that are like a tap, though nobody meant one


NOTHING, LEFT = "nothing", "just left"


def day(seed: int, place: Place, seconds: float, sensor: SimulatedSensor | None = None, wake: str = "") -> Day:
    """So many seconds of everyday life at a place; the same for the same seed.

    If `wake` names a gesture, the person makes it before each meant gesture; both are in `Day.meant`.
    """
    plan = planned(seed, place, seconds, sensor, wake)
    everything = sorted([*plan.life, *((at, made) for at, made, _ in plan.meant)], key=lambda one: one[0])
    take = plan.of.sensor.record(everything, seconds, plan.of.rng)
    alone = [Act.of(one, start) for start, one in plan.life if _like_a_tap(start, one, everything, plan.of.sensor)]
    contacts = sum(_touches(one) for _, one in plan.life)
    meant = tuple((Act.of(one, at), lay) for at, one, lay in plan.meant)
    return Day(place.name, plan.of.person.seed, take, contacts, meant, tuple(alone))


def planned(seed: int, place: Place, seconds: float, sensor: SimulatedSensor | None = None, wake: str = "") -> "Plan":
    """The plan of `day`, without the take of a sensor, for a fraction of the work."""
    rng = generator(seed, 0xDA1, *map(ord, place.name))
    person = Participant(int(rng.integers(1 << 40)) + 2_000_000)
    lived = _Life(place, person, sensor or SimulatedSensor.nominal(day=person.seed), rng, seconds, wake)
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
    wake: str

    def unmeant(self) -> Iterator[Happening]:
        """What nobody means as gestures: postures one after the other, and what happens beside them."""
        names, now = list(self.where.postures), float(self.rng.uniform(*FREE_S))
        chances = np.array([self.where.postures[name] for name in names])
        playing, free = self._habits(FINGERS), [(0.0, now)]
        while now < self.seconds:
            name = names[int(self.rng.choice(len(names), p=chances / chances.sum()))]
            dwell = float(np.clip(self.where.rests[name][1] * self.rng.lognormal(0.0, 0.8), 0.4, 900.0))
            if name == NOBODY:
                free.append((now, now + dwell))
            else:
                made, places = self._rest(name, dwell)
                yield now, made
                for kind, rate in playing.items() if places else ():
                    play = partial(PLAYED[kind], places=places)
                    yield from ((now + at, self._happen(kind, play)) for at in self._times(rate, dwell))
            now += dwell + float(self.rng.uniform(0.3, 3.0))
        for kind, rate in self._habits(self.where.rates).items():
            for at in self._times(rate, self.seconds):
                if kind != "idle_tap" or any(a < at < b for a, b in free):
                    yield at, self._happen(kind, self.where.happenings.get(kind))

    def _habits(self, rates: Mapping[str, float]) -> dict[str, float]:
        """How often an hour this person does each thing; the mean over all people is in `rates`."""
        return {kind: rate * float(self.rng.lognormal(-0.5 * HABIT**2, HABIT)) for kind, rate in rates.items()}

    def meant(self, life: list[Happening]) -> Iterator[tuple[float, Performance, str]]:
        """(start in s, gesture, what lay on the sensor) of each gesture that is meant with a free hand.

        Nothing else moves during such a gesture, and nothing that rests covers its way.
        """
        resting = [(at, at + one.duration_s, one) for at, one in life if one.kind in self.where.rests]
        moving = [(at, at + one.duration_s) for at, one in life if one.kind not in self.where.rests]
        soon = [end + float(self.rng.uniform(0.1, 1.0)) for _, end, _ in resting if self.rng.random() < SOON]
        last = 2.0
        for at in sorted([*self._times(self.where.meant, self.seconds), *soon]):
            under = [one for a, b, one in resting if a - APART_S < at < b + 0.05]
            made = self._beside(at, life, under)
            if made is None:
                continue
            begin, end = at - APART_S, at + made[-1][0] + made[-1][1].duration_s + APART_S
            changes = any(begin < a < end or at < b < end for a, b, _ in resting)
            moves = any(a < end and b > begin for a, b in moving)
            if last < begin and end < self.seconds and not changes and not moves:
                last = end
                left = any(b < at <= b + 1.0 for _, b, _ in resting)
                lay = under[0].kind if under else LEFT if left else NOTHING
                yield from ((at + after, one, lay) for after, one in made)

    def _beside(self, at: float, life: list[Happening], under: list[Performance]) -> list[Happening] | None:
        """A gesture whose way nothing that rests covers, after the `wake` gesture, if any; starts count from `at`.

        None if this person finds no place for it.
        """
        kind = GESTURES[int(self.rng.integers(len(GESTURES)))]
        began = {id(one): start for start, one in life} if under else {}
        lying = [(at - began[id(one)], press) for one in under for press in one.contacts]
        for _ in range(AIMS):
            made: list[Happening] = []
            after = 0.0
            for name in (self.wake, kind) if self.wake else (kind,):
                speed, inclination = any_speed(self.rng), int(self.rng.integers(3))
                one = perform(name, self.person, self.rng, speed, inclination, self.sensor.extent)
                made.append((after, one))
                after += one.duration_s + (float(self.rng.uniform(*AFTER_WAKE_S)) if self.wake else 0.0)
            presses = [(start, press) for start, one in made for press in one.contacts]
            if not any(_covers(since + start, rest, press) for since, rest in lying for start, press in presses):
                return made
        return None

    def _times(self, rate: float, seconds: float) -> list[float]:
        """The moments (s) of a Poisson process with that rate an hour, in order."""
        count = int(self.rng.poisson(rate * seconds / 3600.0))
        return [float(at) for at in np.sort(self.rng.uniform(0.0, seconds, count))]

    def _happen(self, kind: str, make: Maker | None) -> Performance:
        """One performance: by `make`, or one of the simulator's non-gestures."""
        speed, inclination = any_speed(self.rng), int(self.rng.integers(3))
        if make is not None:
            return performed(kind, make, self.person, self.rng, speed, inclination, self.sensor.extent)
        return perform(kind, self.person, self.rng, speed, inclination, self.sensor.extent)

    def _rest(self, name: str, seconds: float) -> tuple[Performance, Places]:
        """Something that rests for a while, and where a hand's fingers lie (mm)."""
        places: list[Places] = []

        def make(occasion: Occasion) -> list[Press]:
            made, found = self.where.rests[name][0](occasion, seconds, self.where.road)
            places.append(found)
            return made

        return self._happen(name, make), places[0]


@dataclass(frozen=True)
class Plan:
    """What happens on a day: what nobody means (`life`), and the gestures, each with what lies on the sensor."""

    of: _Life
    life: list[Happening]
    meant: list[tuple[float, Performance, str]]


def _covers(since: float, rest: Press, press: Press) -> bool:
    """Whether a finger's way comes within COVERS standard deviations of the middle of what rests.

    `since`: for how many seconds that has rested at the finger's time 0.
    """
    then = press.t + since
    dx, dy = press.x - np.interp(then, rest.t, rest.x), press.y - np.interp(then, rest.t, rest.y)
    c, s = math.cos(rest.angle), math.sin(rest.angle)
    far = np.hypot((dx * c + dy * s) / (rest.length + press.length), (dy * c - dx * s) / (rest.width + press.width))
    return bool((far < COVERS).any())


def _touches(one: Performance) -> int:
    """How often something touches the pad in a performance: presses that overlap in time count once."""
    count, until = 0, -math.inf
    for start, end in sorted((float(press.t[0]), float(press.t[-1])) for press in one.contacts):
        count, until = count + (start > until), max(until, end)
    return count


def _like_a_tap(start: float, one: Performance, everything: list[Happening], sensor: SimulatedSensor) -> bool:
    """Whether a contact is like a tap: one finger for at most TAP_S, within TAP_TRAVEL, and nothing else meanwhile."""
    if len(one.contacts) != 1 or not one.contacts[0].finger or one.duration_s > TAP_S:
        return False
    way = math.hypot(np.ptp(one.contacts[0].x), np.ptp(one.contacts[0].y))
    others = (other for other in everything if other[1] is not one)
    return way <= TAP_TRAVEL * min(sensor.extent) and not any(
        at < start + one.duration_s + TAP_S and at + other.duration_s > start - TAP_S for at, other in others
    )
