"""How much of a gap `gestured-lab adapt` closes on a kind of sensor that simulation left out altogether.

    python -m experiments.kinds --cache .cache/lab

The base learned and was calibrated without that kind (`experiments.ablation`, whose networks are taken from the cache).
It is adapted to some sensors of the kind, each with the gestures of one to six people, and judged on other people's on
the same sensor; so is the network that learned from all kinds.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from experiments.ablation import KINDS, network
from experiments.curve import Said, of_people, table
from gestured.lab.adapt.adaptation import settled
from gestured.lab.adapt.learning import Course
from gestured.lab.adapt.material import Own
from gestured.lab.adapt.takes import simulate
from gestured.lab.cli import CACHE
from gestured.lab.dataset import from_take
from gestured.lab.samples import Sample, collect
from gestured.simulator import (
    GESTURES,
    INCLINATIONS,
    NON_GESTURES,
    NONE,
    SPEEDS,
    Participant,
    SimulatedSensor,
    generator,
    gesture_take,
    wide_plan,
)

CHOSEN = ("sensors like touchscreens", "touches of at most 25 times the noise")  # the two that are most of the takes
SENSORS = 3  # of each kind
PEOPLE = (1, 3, 6)  # that a model is adapted with
JUDGES = 12  # other people
BASE, EVERY = "nobody (the kind left out)", "the kind among those learned from"
SEED = 71  # of the sensors and of whoever touches them


def sensors(kind: str) -> Iterator[SimulatedSensor]:
    """The first sensors of the kind in a stream that teaches nothing."""
    found, index = 0, 0
    while found < SENSORS:
        plan = wide_plan(SEED, index)
        index += 1
        if KINDS[kind](plan):
            found += 1
            yield plan.sensor


def evening(sensor: SimulatedSensor, nth: int) -> Own:
    """All people on one sensor: each gesture at each speed, each non-gesture once."""
    samples: list[Sample] = []
    missed: list[tuple[int, int]] = []
    sittings: list[int] = []
    numbers = range(nth * 1000, nth * 1000 + max(PEOPLE) + JUDGES)
    for number in numbers:
        person, rng = Participant(SEED * 1_000_000 + number), generator(SEED, nth, number)
        plans = [(kind, speed) for kind in GESTURES for speed in SPEEDS] + [(kind, "normal") for kind in NON_GESTURES]
        for kind, speed in plans:
            place = number * len(SPEEDS) + list(SPEEDS).index(speed)
            take = gesture_take(kind, person, sensor, rng, speed, int(rng.integers(len(INCLINATIONS))))
            cut = [one._replace(person=number) for one in from_take(take)]
            samples += cut
            sittings += [place] * len(cut)
            if kind in GESTURES and not any(one.label != NONE for one in cut):
                missed.append((number, place))
    lost = np.array(missed, np.int64).reshape(-1, 2)
    return Own(collect(samples), np.array(sittings), tuple(map(str, numbers)), lost, {})


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, default=CACHE, help="of a training (%(default)s)")
    args = parser.parse_args()
    torch.set_num_threads(1)
    takes, course = simulate(args.cache, 2), Course()
    every = network(args.cache, None)
    for kind in CHOSEN:
        base, least = network(args.cache, kind)
        said = {name: Said() for name in (BASE, *(f"{count} people" for count in PEOPLE), EVERY)}
        for nth, sensor in enumerate(sensors(kind)):
            own = evening(sensor, nth)
            people = np.array(own.names, np.int64)
            judges = of_people(own, people[max(PEOPLE) :])
            said[BASE].add(base, least, judges)
            for count in PEOPLE:
                found = settled(base, least, of_people(own, people[:count]), takes, course)
                said[f"{count} people"].add(found.judged, found.least, judges)
            said[EVERY].add(*every, judges)
            print(f"{kind}, {nth + 1} of {SENSORS} sensors", table(said), sep="\n\n", flush=True)


if __name__ == "__main__":
    main()
