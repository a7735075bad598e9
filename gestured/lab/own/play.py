"""Simulated people who repeat gestures of their own.

One performance is the plan; a repetition is the same path with what a hand varies: place, size, rotation, speed, force,
and a slow sway. Some plans are signs, letters and figures that somebody may choose and that no network has learned.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from gestured.lab.dataset import STREAMS, cuts, matched, simulated, truths
from gestured.lab.digest import code_digest
from gestured.lab.samples import Sample, Samples
from gestured.simulator import (
    GESTURES,
    NON_GESTURES,
    Participant,
    Performance,
    SimulatedSensor,
    any_sensor,
    generator,
    perform,
)
from gestured.simulator.cohort import performed, recorded
from gestured.simulator.drawn import drawn
from gestured.simulator.kinematics import polyline, wander
from gestured.simulator.occasion import Occasion
from gestured.simulator.people import Press, any_speed

Corners = tuple[tuple[float, float], ...]  # in a square of side 1, x to the right, y upward, in the order of drawing
SIGNS: dict[str, Corners] = {
    "letter_m": ((0.0, 0.0), (0.1, 1.0), (0.5, 0.3), (0.9, 1.0), (1.0, 0.0)),
    "letter_n": ((0.0, 0.0), (0.0, 1.0), (0.8, 0.0), (0.8, 1.0)),
    "letter_s": ((0.9, 0.9), (0.4, 1.0), (0.1, 0.75), (0.5, 0.5), (0.9, 0.25), (0.6, 0.0), (0.1, 0.1)),
    "letter_z": ((0.0, 1.0), (1.0, 1.0), (0.0, 0.0), (1.0, 0.0)),
    "letter_u": ((0.0, 1.0), (0.05, 0.2), (0.4, 0.0), (0.75, 0.2), (0.8, 1.0)),
    "letter_h": ((0.0, 1.0), (0.0, 0.0), (0.05, 0.5), (0.5, 0.55), (0.6, 0.0)),
    "square": ((0.0, 1.0), (0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)),
    "triangle": ((0.5, 1.0), (0.0, 0.0), (1.0, 0.0), (0.5, 1.0)),
    "arrow": ((0.0, 0.5), (1.0, 0.5), (0.65, 0.85), (1.0, 0.5), (0.65, 0.15)),
    "hook": ((0.0, 1.0), (0.0, 0.0), (0.4, 0.0), (0.4, 0.5)),
    "loop": ((0.0, 0.0), (0.5, 0.1), (0.9, 0.5), (0.6, 0.9), (0.3, 0.6), (0.6, 0.1), (1.1, 0.0)),
    "star": ((0.2, 0.0), (0.5, 1.0), (0.8, 0.0), (0.0, 0.65), (1.0, 0.65), (0.2, 0.0)),
    "letter_w": ((0.0, 1.0), (0.25, 0.0), (0.5, 0.7), (0.75, 0.0), (1.0, 1.0)),
    "letter_p": ((0.0, 0.0), (0.0, 1.0), (0.5, 0.95), (0.6, 0.7), (0.45, 0.5), (0.05, 0.45)),
    "letter_k": ((0.0, 1.0), (0.0, 0.0), (0.6, 1.0), (0.05, 0.5), (0.7, 0.0)),
    "letter_e": ((0.1, 0.5), (0.8, 0.55), (0.5, 0.95), (0.1, 0.6), (0.2, 0.1), (0.8, 0.1)),
    "figure_two": ((0.0, 0.8), (0.4, 1.0), (0.75, 0.75), (0.0, 0.0), (0.9, 0.0)),
    "figure_three": ((0.0, 0.95), (0.6, 0.9), (0.3, 0.5), (0.7, 0.3), (0.4, 0.0), (0.0, 0.1)),
    "house": ((0.0, 0.0), (0.0, 0.6), (0.5, 1.0), (1.0, 0.6), (1.0, 0.0)),
    "stairs": ((0.0, 1.0), (0.35, 1.0), (0.35, 0.6), (0.7, 0.6), (0.7, 0.2), (1.05, 0.2)),
    "clip": ((0.0, 0.0), (0.0, 1.0), (0.5, 1.0), (0.5, 0.2), (0.25, 0.2), (0.25, 0.7)),
    "bow": ((0.0, 1.0), (0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)),
}
LEARNED, JUDGED = tuple(SIGNS)[::2], tuple(SIGNS)[1::2]  # to learn thresholds from, and to judge them by
LEG_S = 0.28  # s for a leg as long as half of the pad


def sign(
    kind: str,
    participant: Participant,
    rng: np.random.Generator,
    speed: str = "normal",
    inclination: int = 1,
    extent: tuple[float, float] = (72.0, 72.0),
) -> Performance:
    """One sign as one person draws it, in the manner of `simulator.perform`."""
    return performed(kind, partial(_made, SIGNS[kind]), participant, rng, speed, inclination, extent)


def _made(corners: Corners, occasion: Occasion) -> list[Press]:
    rng, far = occasion.rng, 0.5 * occasion.small
    size = occasion.small * (0.45 + 0.4 * occasion.reach())
    points = [(size * (x + rng.normal(0.0, 0.04)), size * (y + rng.normal(0.0, 0.04))) for x, y in corners]
    legs = [
        float(np.clip(LEG_S * (math.dist(a, b) / far) ** 0.4 / occasion.rate, 0.1, 0.9))
        for a, b in zip(points[:-1], points[1:], strict=True)
    ]
    t, x, y = polyline(points, legs, float(rng.uniform(0.1, 0.35)), 0.0)
    return drawn(occasion, t, x, y)


PLAN = "plan"  # label of a repetition; other performances have their usual labels
REPETITIONS = 9  # of a plan: five examples, and four to try them on
# What lies or rubs on the sensor, and faults: nobody performs these on purpose.
NOT_PERFORMED = (
    "palm", "heel_rest", "forearm", "wipe", "object_put_down", "sleeve_brush", "wrinkle", "electrical_burst", "spike",
)  # fmt: skip
PERFORMED = tuple(kind for kind in NON_GESTURES if kind not in NOT_PERFORMED)
HARD = 3  # every third person has a random sensor, at half the greatest hardness
FIRST_PERSON = 500_000  # people from here on occur nowhere else in the lab
GESTURE_TRIALS, OTHER_TRIALS = 4, 2  # performances of each kind, in any manner


def played(cache: Path, people: int, jobs: int = 2, *, judge: bool = False) -> Samples:
    """Samples of so many people, one after the other: repetitions of plans, the model's gestures, and everything else.

    The plans are the kinds of non-gestures that somebody could perform, and signs that no network has learned; with
    `judge` other people and other signs. The samples come from `cache` if they were made before.
    """
    stream = f"own-{code_digest(__name__)[:8]}"
    STREAMS[stream] = _part
    parts = len(PERFORMED + LEARNED + GESTURES + NON_GESTURES)
    return simulated(cache, stream, TO_JUDGE if judge else TO_LEARN, people * parts, jobs)


TO_LEARN, TO_JUDGE = 0, 1  # seeds


def _part(seed: int, index: int) -> list[Sample]:
    """One person's repetitions of one plan, or that person's performances of one kind."""
    plans = PERFORMED + (JUDGED if seed == TO_JUDGE else LEARNED)
    kinds = plans + GESTURES + NON_GESTURES
    nth, part = divmod(index, len(kinds))
    kind, number = kinds[part], FIRST_PERSON + 10_000 * seed + nth
    person, rng = Participant(number), generator(number, 0x5E)
    sensor = any_sensor(rng, 0.5) if nth % HARD == 0 else SimulatedSensor.nominal(day=number)
    found: list[Sample] = []
    if part < len(plans):
        rng = generator(number, part)
        plan = (sign if kind in SIGNS else perform)(kind, person, rng, any_speed(rng), 1, sensor.extent)
        for trial in range(REPETITIONS):
            rng = generator(number, part, trial)
            found += _recorded(repeated(plan, rng, sensor.extent), sensor, rng, PLAN)
        return found
    for trial in range(GESTURE_TRIALS if kind in GESTURES else OTHER_TRIALS):
        rng = generator(number, part, trial)
        done = perform(kind, person, rng, any_speed(rng), int(rng.integers(3)), sensor.extent)
        found += _recorded(done, sensor, rng, done.label)
    return found


def _recorded(
    performance: Performance, sensor: SimulatedSensor, rng: np.random.Generator, label: str
) -> Iterator[Sample]:
    """The segment that is cut out of a performance; nothing if there are several, or none."""
    take = recorded(performance, sensor, rng)
    found = list(matched(cuts(take.frames, take.times), truths(take)))
    if len(found) == 1:
        yield found[0]._replace(label=label)


def repeated(plan: Performance, rng: np.random.Generator, extent: tuple[float, float]) -> Performance:
    """A repetition of a plan, as a hand varies it, on a pad of `extent` millimetres."""
    xs, ys = (np.concatenate([getattr(contact, axis) for contact in plan.contacts]) for axis in "xy")
    middle_x, middle_y, size = xs.mean(), ys.mean(), math.hypot(np.ptp(xs), np.ptp(ys))
    turn, tempo, force = rng.normal(0.0, math.radians(6.0)), rng.lognormal(0.0, 0.12), rng.lognormal(0.0, 0.2)
    scale_x, scale_y = rng.lognormal(0.0, 0.1) * rng.lognormal(0.0, 0.05, 2)
    at_x, at_y = np.array([middle_x, middle_y]) + rng.normal(0.0, 0.05, 2) * np.array(extent)
    c, s = math.cos(turn), math.sin(turn)
    contacts = []
    for contact in plan.contacts:
        dx, dy, t = (contact.x - middle_x) * scale_x, (contact.y - middle_y) * scale_y, contact.t * tempo
        off_x, off_y = rng.normal(0.0, 0.02, 2) * size
        x = at_x + c * dx - s * dy + off_x + 0.03 * size * wander(t - t[0], rng, 0.3, 1.5, 3)
        y = at_y + s * dx + c * dy + off_y + 0.03 * size * wander(t - t[0], rng, 0.3, 1.5, 3)
        broad = rng.lognormal(0.0, 0.08)
        pressed, angle = contact.force * force * rng.lognormal(0.0, 0.05), contact.angle + float(rng.normal(0.0, 0.15))
        x, y = np.clip(x, 0.0, extent[0]), np.clip(y, 0.0, extent[1])
        length, width = contact.length * broad, contact.width * broad
        contacts.append(replace(contact, t=t, x=x, y=y, force=pressed, length=length, width=width, angle=angle))
    return replace(plan, contacts=tuple(contacts), duration_s=plan.duration_s * tempo)
