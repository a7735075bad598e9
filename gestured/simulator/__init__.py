"""A simulator of people, fingers, a textile and its sensor, in plain numpy.

It has human strokes in continuous time (`perform`), a soft matrix sensor that samples, blurs, leaks, lags and quantises
them (`SimulatedSensor.record`), and seeded collections of takes (`cohort_take`, `wide`, `session`). It is no
finite-element model of fabric, and is not fitted to textile recordings (none were at hand). Its distributions are
invented within plausible bounds; only blob sizes, durations and speeds were compared with real fingers, which touched a
touchscreen. A figure that is measured on the simulator is a figure about the simulator.

All random numbers come from PCG64 with SeedSequences, and frames are integers, so the same seed gives the same takes.
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
