"""What the simulated sensor of `gesturectl` plays: frames of a person who performs gesture after gesture."""

import argparse
import textwrap
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, cycle

from gestured.client.program import Parser
from gestured.client.values import number, rows_by_columns, some_of
from gestured.core.frames import Frame
from gestured.record.recordings import touches_of
from gestured.simulator import (
    GESTURES,
    NON_GESTURES,
    SEQUENCES,
    SPEEDS,
    Participant,
    SimulatedSensor,
    Take,
    at_random,
    generator,
    session,
)
from gestured.simulator.everyday import day
from gestured.simulator.places import PLACES

KINDS = GESTURES + NON_GESTURES + SEQUENCES
FIRST = 900  # the person of `--seed 0`; the models learned from 0 to 33
OTHERS = 0.2  # share of performances that are no gesture, if no kinds are named
PART_S = 600.0  # the longest part that is simulated at a time
PART_COUNTS = 5_000_000  # the most counts in a part, since each takes about 50 bytes
LEAST_S = 10.0  # the shortest part if frames are large or many, since something is to be performed in it
OFF_S = 3.0  # the sensor is off for so long between two parts
UNTOUCHED_S = 2.0  # nobody touches the sensor for so long at first, so that the daemon learns the baseline
BETWEEN_S = (1.0, 2.0)  # the pauses between performances


def takes(args: argparse.Namespace, seconds: float | None) -> Iterator[tuple[float, Take]]:
    """(start in s from 0, take) of one part after the other, `seconds` in all, or without end if None.

    The same flags give the same frames. With `args.everyday` each part is everyday contact of another person there.
    """
    rows, columns = args.grid
    most = max(min(PART_S, PART_COUNTS / (rows * columns * args.rate)), LEAST_S)
    start, part = 0.0, 0
    while seconds is None or start < seconds:
        length = most if seconds is None else min(most, seconds - start)
        if args.everyday:
            seed = args.seed + part
            yield start, day(seed, PLACES[args.everyday], length, _sensor(args, seed)).take
        else:
            yield start, performance(args, length, part)
        start, part = start + length + OFF_S, part + 1


def _sensor(args: argparse.Namespace, of_day: int) -> SimulatedSensor:
    rows, columns = args.grid
    nominal = SimulatedSensor.nominal(day=of_day)
    pitch = min(nominal.extent) / min(rows, columns)
    return replace(nominal, rows=rows, columns=columns, pitch_mm=pitch, rate_hz=args.rate)


def performance(args: argparse.Namespace, seconds: float, part: int = 0, first: str | None = None) -> Take:
    """One part of what a person performs; it begins with the kind `first` if the flags name no kinds."""
    person = FIRST + args.seed
    rng = generator(args.seed, 0xC7, person, part)
    at_first = [first] if first else []
    kinds = cycle(args.kinds) if args.kinds else chain(at_first, at_random(rng, OTHERS))
    return session(
        Participant(person), _sensor(args, person), rng, seconds,
        idle_s=BETWEEN_S, kinds=kinds, lead_s=UNTOUCHED_S, speed=args.speed,
    )  # fmt: skip


def frames(start: float, take: Take) -> Iterator[tuple[int, Frame]]:
    """(the sensor's counter, frame) of a take that begins at `start` seconds."""
    for n, values in enumerate(take.frames):
        touches = touches_of(take.touch_ids[n], take.touches[n])
        yield int(take.counter[n]), Frame(start + float(take.times[n]), values, touches)


def add_arguments(parser: Parser) -> None:
    """Add the flags that say what is played, and a list of all kinds at the end of the help."""
    kinds = textwrap.indent(textwrap.fill(", ".join(KINDS), 98), "  ")
    parser.epilog = f"{parser.epilog}\n\nkinds for --kinds:\n{kinds}"
    text = "another person, and another sequence of gestures (default: 0)"
    parser.takes("--seed", "N", text, type=number(0, 10**6, whole=True), default=0)
    text = "perform these kinds, listed below, in turn (default: at random)"
    parser.takes("--kinds", "A,B", text, type=some_of(KINDS), default=())
    parser.add_argument("--speed", choices=tuple(SPEEDS), help="how fast the person moves (default: mixed)")
    parser.takes("--rate", "HZ", "frames a second (default: 15)", type=number(5.0, 1000.0), default=15.0)
    parser.takes("--grid", "RxC", "rows and columns (default: 9x9)", type=rows_by_columns, default=(9, 9))
