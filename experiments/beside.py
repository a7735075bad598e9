"""A swipe beside something that was laid on a sensor some seconds before, by what it is and how long it lies there.

    python -m experiments.beside --document docs/limits-and-choices.md

The people are simulated, and no model has learned from them; what rests never covers the way of the swipe.
"""

import argparse
from functools import partial

from experiments.pages import add_document, tell
from gestured.core.frames import Frame
from gestured.core.points import USUAL
from gestured.core.scene import Setup
from gestured.lab.dataset import in_processes
from gestured.lab.everyday.command import at
from gestured.lab.everyday.hours import Heard, hear, judged, points_of
from gestured.lab.everyday.stretches import Stretch
from gestured.lab.table import Table
from gestured.model.shipped import shipped
from gestured.record.judge import Performed
from gestured.simulator import Participant, SimulatedSensor, generator
from gestured.simulator.cohort import perform, performed
from gestured.simulator.everyday import _covers
from gestured.simulator.resting import rest

LAID = ("forearm", "elbow", "hand", "thing")
WAITS_S = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 30.0)
FREE_S = 5.0  # s for which the sensor is idle before something is laid on
SWIPES = ("swipe_left", "swipe_right", "swipe_up", "swipe_down")
ROAD = 0.06  # as on the armrest of gestured/simulator/places.py
MODEL = "cnn_lstm"
FIRST = 9_000_000  # the first person; nobody learns from them


def case(name: str, wait: float, n: int) -> Stretch:
    """A stretch of one person: one thing laid on, and one swipe beside it `wait` seconds later."""
    person, rng = Participant(FIRST + n), generator(n, 0xBE5)
    sensor = SimulatedSensor.nominal(day=person.seed)
    kind = SWIPES[n % len(SWIPES)]
    while True:
        lies = performed(name, lambda of: rest(name, of, wait + 6.0, ROAD)[0], person, rng, "normal", 1, sensor.extent)
        swipe = perform(kind, person, rng, "normal", 1, sensor.extent)
        if not any(_covers(wait, one, press) for one in lies.contacts for press in swipe.contacts):
            break
    begin = FREE_S + wait
    take = sensor.record([(FREE_S, lies), (begin, swipe)], begin + swipe.duration_s + 2.0, rng)
    meant = [Performed(kind, name, begin, begin + swipe.duration_s)]
    setup = Setup(grid=take.frames[0].shape)
    return Stretch(name, str(n), map(Frame, take.times.tolist(), take.frames), setup, meant, [])


def heard(count: int, which: int) -> list[Heard]:
    """The model's answers to `count` people, for cell `which` of the table: one thing, and one wait."""
    name, wait = LAID[which // len(WAITS_S)], WAITS_S[which % len(WAITS_S)]
    return [hear(case(name, wait, n), at(MODEL, USUAL)[:1], USUAL) for n in range(count)]


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--people", type=int, default=100, help="for each cell (%(default)s)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (%(default)s)")
    add_document(parser, "beside")
    args = parser.parse_args()
    found = list(in_processes(partial(heard, args.people), range(len(LAID) * len(WAITS_S)), args.jobs, "cells"))
    least = points_of(at(MODEL, USUAL)[0])[USUAL]
    right = [judged(cell, MODEL, least).said["right"] / args.people for cell in found]
    rows = [(f"{wait:g} s", *(f"{share:.2f}" for share in right[k :: len(WAITS_S)])) for k, wait in enumerate(WAITS_S)]
    notes = (f"Shares of {args.people} swipes each that are recognised at {USUAL}.",)
    table = Table("A swipe beside what was laid on so long before", ("laid on before", *LAID), rows, notes)
    tell(table, [shipped()[MODEL]], "beside", args.document)


if __name__ == "__main__":
    main()
