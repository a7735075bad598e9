"""Takes and sessions: one gesture, many gestures, the cohort of 3060 takes, and the endless wide stream.

Each take has a random generator of its own, seeded with the take's coordinates, so any part can be made alone and in
parallel.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from gestured.simulator.gestures import TEN
from gestured.simulator.occasion import Maker, Occasion
from gestured.simulator.others import OTHERS
from gestured.simulator.people import (
    INCLINATIONS,
    SPEEDS,
    Artefact,
    Participant,
    Performance,
    Press,
    any_speed,
    generator,
)
from gestured.simulator.sensor import SimulatedSensor, Take
from gestured.simulator.variety import any_sensor

GESTURES: tuple[str, ...] = tuple(TEN)
# Gestures right after one another may be recognised as such, so these kinds are not among NON_GESTURES.
SEQUENCES = ("tap_then_swipe", "tap_then_hold", "triple_tap")
NON_GESTURES: tuple[str, ...] = tuple(kind for kind in OTHERS if kind not in SEQUENCES)
NONE = "none"
OTHERS_SHARE = 0.35  # share of the wide stream that is none of the ten gestures
LEAD_S, TAIL_S = 1.3, 0.8  # the pad is idle so long before (plus up to one frame) and after a single performance
LAST_PAUSE_S = 1.0  # the pad is idle for so long at least at the end of a session
FLICKS = 0.25  # share of the hardest takes in which strokes are hurried, so that some last two to four frames


def perform(
    kind: str,
    participant: Participant,
    rng: np.random.Generator,
    speed: str = "normal",
    inclination: int = 1,
    extent: tuple[float, float] = (72.0, 72.0),
    hurry: float = 1.0,
) -> Performance:
    """One performance of a gesture or non-gesture on a pad of `extent` millimetres (width, height).

    `hurry` is a factor on the speed of strokes beyond `speed`: with 2 a swipe lasts two to four frames.
    Raises ValueError for an unknown kind, speed or inclination.
    """
    if kind not in TEN and kind not in OTHERS:
        raise ValueError(f"kind: {kind!r} is none of {', '.join(GESTURES + NON_GESTURES + SEQUENCES)}")
    if speed not in SPEEDS:
        raise ValueError(f"speed: {speed!r} is none of {', '.join(SPEEDS)}")
    if inclination not in INCLINATIONS:
        raise ValueError(f"inclination: {inclination!r} is none of 0, 1, 2")
    make = TEN[kind] if kind in TEN else OTHERS[kind]
    return performed(kind, make, participant, rng, speed, inclination, extent, hurry)


def performed(
    kind: str,
    make: Maker,
    participant: Participant,
    rng: np.random.Generator,
    speed: str,
    inclination: int,
    extent: tuple[float, float],
    hurry: float = 1.0,
) -> Performance:
    """One performance by a maker such as those in TEN and OTHERS; it is labelled as a gesture if `kind` is in TEN."""
    turn, grow, press = participant.pose(inclination)
    rate = participant.rate(rng, speed) * hurry
    made = make(Occasion(rng, participant, *extent, speed, rate, turn + participant.bias, grow, press))
    contacts = tuple(m for m in made if isinstance(m, Press))
    artefacts = tuple(m for m in made if isinstance(m, Artefact))
    stops = [float(c.t[-1]) for c in contacts] + [a.stop for a in artefacts]
    label = kind if kind in TEN else NONE
    return Performance(kind, label, contacts, max(stops), speed, inclination, participant.seed, artefacts)


def gesture_take(
    kind: str,
    participant: Participant,
    sensor: SimulatedSensor,
    rng: np.random.Generator,
    speed: str = "normal",
    inclination: int = 1,
    hurry: float = 1.0,
) -> Take:
    """One performance with an idle pad before and after it."""
    return recorded(perform(kind, participant, rng, speed, inclination, sensor.extent, hurry), sensor, rng)


def recorded(performance: Performance, sensor: SimulatedSensor, rng: np.random.Generator) -> Take:
    """The take of one performance, with an idle pad before and after it."""
    start = LEAD_S + float(rng.random()) / sensor.rate_hz
    return sensor.record([(start, performance)], start + performance.duration_s + TAIL_S, rng)


def at_random(rng: np.random.Generator, non_gesture_share: float) -> Iterator[str]:
    """Random kinds without end: gestures, and a share of non-gestures."""
    while True:
        pool = NON_GESTURES if rng.random() < non_gesture_share else GESTURES
        yield pool[int(rng.integers(len(pool)))]


def session(
    participant: Participant,
    sensor: SimulatedSensor,
    rng: np.random.Generator,
    seconds: float = 60.0,
    non_gesture_share: float = 0.25,
    idle_s: tuple[float, float] = (0.9, 3.0),
    kinds: Iterable[str] | None = None,
    lead_s: float = 2.0,
    speed: str | None = None,
) -> Take:
    """A continuous recording of that many seconds: performances in random order with idle gaps of `idle_s` between.

    `kinds`, if given, are performed in their order as far as the time allows; `speed`, if given, is that of all.
    """
    performances: list[tuple[float, Performance]] = []
    inclination = int(rng.integers(3))
    now = lead_s
    for kind in at_random(rng, non_gesture_share) if kinds is None else kinds:
        performance = perform(kind, participant, rng, speed or any_speed(rng), inclination, sensor.extent)
        if now + performance.duration_s + LAST_PAUSE_S > seconds:
            break
        performances.append((now, performance))
        now += performance.duration_s + float(rng.uniform(*idle_s))
    return sensor.record(performances, seconds, rng)


@dataclass(frozen=True, slots=True)
class Trial:
    """One cell of the cohort's factorial plan."""

    index: int
    participant: int
    gesture: str
    speed: str
    inclination: int


def cohort_plan(participants: int = 34) -> Iterator[Trial]:
    """The cohort's trials in order: participant, gesture, speed, inclination (34 x 10 x 3 x 3 = 3060)."""
    cells = product(range(participants), GESTURES, SPEEDS, INCLINATIONS)
    return (Trial(index, *cell) for index, cell in enumerate(cells))


def cohort_take(trial: Trial, seed: int = 0) -> Take:
    """One trial of the cohort, on the nominal sensor on that participant's day; needs no other trial."""
    rng = generator(seed, 0xC0, trial.index)
    person = seed * 1000 + trial.participant
    sensor = SimulatedSensor.nominal(day=person)
    return gesture_take(trial.gesture, Participant(person), sensor, rng, trial.speed, trial.inclination)


class WideTake(NamedTuple):
    """The plan of a take of the wide stream: what `gesture_take` takes, which continues with the state of `rng`."""

    kind: str
    participant: Participant
    sensor: SimulatedSensor
    rng: np.random.Generator
    speed: str
    inclination: int
    hurry: float


def wide_plan(seed: int, index: int, hardness: float | None = None) -> WideTake:
    """The plan of the take that `wide` makes, for a thousandth of the work."""
    rng = generator(seed, 0x71DE, index)
    hard = float(rng.random()) if hardness is None else hardness
    person = Participant(int(rng.integers(1 << 40)) + 1_000_000)
    sensor = any_sensor(rng, hard)
    kind = next(at_random(rng, OTHERS_SHARE))
    speed = any_speed(rng)
    hurry = float(rng.uniform(1.3, 2.5)) if rng.random() < FLICKS * hard else 1.0
    return WideTake(kind, person, sensor, rng, speed, int(rng.integers(3)), hurry)


def wide(seed: int, index: int, hardness: float | None = None) -> Take:
    """The take of that index in an endless stream: a random participant on a random sensor.

    `hardness` (0..1, as in `any_sensor`) is random for each take unless it is given.
    """
    return gesture_take(*wide_plan(seed, index, hardness))
