"""A simulator of people, fingers, a textile and its sensor, in plain numpy.

What it is: human strokes in continuous time (`perform`), a soft matrix sensor that samples, blurs, leaks,
lags and quantises them (`SimulatedSensor.record`), and seeded collections of both (`cohort_take`, `wide`, `session`).
What it is not: a finite-element model of a fabric, nor fitted to textile recordings (none were at hand). Its
distributions are invented within plausible bounds; blob sizes, durations and speeds were compared with real
fingers on a touchscreen only. A figure measured on it is a figure about it.
Everything is drawn from PCG64 on SeedSequences and ends in integer counts: the same seed gives the same
takes.
"""

from gestured.simulator.cohort import (
    GESTURES,
    NON_GESTURES,
    NONE,
    SEQUENCES,
    Trial,
    at_random,
    cohort_plan,
    cohort_take,
    gesture_take,
    perform,
    session,
    wide,
    wide_plan,
)
from gestured.simulator.people import INCLINATIONS, SPEEDS, Participant, Performance, generator
from gestured.simulator.sensor import Act, SimulatedSensor, Take
from gestured.simulator.variety import any_sensor

__all__ = [
    "GESTURES", "INCLINATIONS", "NONE", "NON_GESTURES", "SEQUENCES", "SPEEDS", "Act", "Participant", "Performance",
    "SimulatedSensor", "Take", "Trial", "any_sensor", "at_random", "cohort_plan", "cohort_take", "generator",
    "gesture_take", "perform", "session", "wide", "wide_plan",
]  # fmt: skip
