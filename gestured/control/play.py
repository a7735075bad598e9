"""What the simulated sensor plays: a person who performs gesture after gesture, and the frames of it."""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, cycle

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

PART_S = 600.0  # what is simulated at a time; between two parts the sensor is off
OFF_S = 3.0
UNTOUCHED_S = 2.0  # untouched at first: the daemon learns the baseline
BETWEEN_S = (1.0, 2.0)  # between performances


@dataclass(frozen=True)
class Play:
    """Who performs what, on which sensor. The same play gives the same frames."""

    seed: int
    participant: int
    rate_hz: float
    rows: int
    columns: int
    kinds: Sequence[str]  # in this order, again and again; none: at random
    non_gestures: float  # share of what is performed at random
    speed: str | None  # None: mixed
    first: str | None = None  # what is performed before all else, where `kinds` does not say

    def takes(self, seconds: float | None) -> Iterator[tuple[float, Take]]:
        """(start, take) one after the other, `seconds` in all or without end; times in seconds from 0."""
        start, part = 0.0, 0
        while seconds is None or start < seconds:
            length = PART_S if seconds is None else min(PART_S, seconds - start)
            yield start, self._take(part, length)
            start, part = start + length + OFF_S, part + 1

    def _take(self, part: int, seconds: float) -> Take:
        rng = generator(self.seed, 0xC7, self.participant, part)
        nominal = SimulatedSensor.nominal(day=self.participant)
        pitch = min(nominal.extent) / min(self.rows, self.columns)
        sensor = replace(nominal, rows=self.rows, columns=self.columns, pitch_mm=pitch, rate_hz=self.rate_hz)
        first = [self.first] if self.first else []
        kinds = cycle(self.kinds) if self.kinds else chain(first, at_random(rng, self.non_gestures))
        person = Participant(self.participant)
        return session(
            person, sensor, rng, seconds, idle_s=BETWEEN_S, kinds=kinds, lead_s=UNTOUCHED_S, speed=self.speed
        )


def frames(start: float, take: Take) -> Iterator[tuple[int, Frame]]:
    """(the sensor's counter, frame) of a take that begins at `start` seconds."""
    for n, values in enumerate(take.frames):
        touches = touches_of(take.touch_ids[n], take.touches[n])
        yield int(take.counter[n]), Frame(start + float(take.times[n]), values, touches)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The flags of a play."""
    parser.add_argument(
        "--participant",
        type=int,
        default=900,
        metavar="N",
        help="who performs (default: 900; the models learned from 0 to 33)",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="another order of things (default: 0)")
    parser.add_argument(
        "--kinds",
        type=some_of(GESTURES + NON_GESTURES + SEQUENCES),
        default=(),
        metavar="A,B",
        help="perform these in turn (default: at random)",
    )
    parser.add_argument(
        "--non-gestures",
        type=number(0.0, 1.0),
        default=0.2,
        metavar="SHARE",
        help="share of what is no gesture (default: 0.2)",
    )
    parser.add_argument("--speed", choices=tuple(SPEEDS), help="how fast the person moves (default: mixed)")
    parser.add_argument(
        "--rate", type=number(5.0, 1000.0), default=15.0, metavar="HZ", help="frames a second (default: 15)"
    )
    parser.add_argument(
        "--grid", type=rows_by_columns, default=(9, 9), metavar="RxC", help="rows and columns (default: 9x9)"
    )


def play_from(args: argparse.Namespace) -> Play:
    """The play that the flags ask for."""
    rows, columns = args.grid
    return Play(args.seed, args.participant, args.rate, rows, columns, args.kinds, args.non_gestures, args.speed)
