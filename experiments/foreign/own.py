"""Judge gestures of one's own on the independent generator: the same person, kinds that no model has learned from it.

    python -m experiments.foreign.own --model cnn_lstm --people 10

A kind is performed as that generator does it, which is any way at all (a zigzag in any direction): a person who repeats
himself is easier. So this is reported, not promised; and recall by kind, after as many examples each, says which kinds
are the same thing each time.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from experiments.foreign import GESTURES, LEVELS, NON_GESTURES
from experiments.foreign.hands import Performance, draw_person, perform
from experiments.foreign.sensors import draw_sensor, record
from gestured.core.classifier import NEAR
from gestured.core.frames import Segment
from gestured.core.own import EXAMPLES
from gestured.lab.dataset import cuts
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.own import Placed
from gestured.model.prototypes import Array, Prototype, Space, nearest

PERFORMED = (
    "long_press", "scribble", "zigzag", "pinch", "two_finger_tap", "check_mark", "two_finger_sideways",
    "diagonal_swipe",
)  # fmt: skip
TRIALS = EXAMPLES + 4  # of each kind
OTHER_TRIALS = 4
SHOWN = (1, 3, 5)  # examples


@dataclass(frozen=True)
class Seen:
    """One segment: what was done, where it lies, and what the model makes of it."""

    kind: str
    place: Array
    known: bool
    claimed: bool  # whether it would be refused as an example


def segments(performed: Performance, sensor: object, rng: np.random.Generator) -> list[Segment]:
    """What the front end cuts out of one performance."""
    start = 1.4 + float(rng.uniform(0.0, 0.4))
    frames, times, _ = record(sensor, rng, [(start, performed)], start + performed.duration + 1.4)
    return cuts(frames, times)


def done(model: Model, seed: int, level: str) -> Iterator[Seen]:
    """Everything that one person does at one sheet."""
    assert model.space is not None
    rng = np.random.default_rng([seed, 77, LEVELS.index(level)])
    person, sensor = draw_person(rng, level), draw_sensor(rng, level)
    for kind in GESTURES + NON_GESTURES:
        for _ in range(TRIALS if kind in PERFORMED else OTHER_TRIALS):
            for segment in segments(perform(kind, rng, person), sensor, rng)[:1]:
                scores = model.classify(segment)
                placed = Placed.of(model, model.space, segment)
                known = scores.confidence >= scores.threshold
                yield Seen(kind, placed.place, known, placed.taken is not None)


def taken(space: Space, prototypes: dict[str, Prototype], chosen: list[Seen]) -> Array:
    """How many of what was chosen are answered with an own gesture, and of how many."""
    matches = [(one, nearest(space, prototypes, one.place)) for one in chosen]
    own = [match and match.confidence >= NEAR and (not one.known or match.nearer) for one, match in matches]
    return np.array([sum(map(bool, own)), len(own)], np.float64)


def judge(model: Model, people: int, level: str) -> None:
    """Print recall, and what else is taken, by the number of examples."""
    space = model.space
    if space is None:
        raise SystemExit(f"{model.name}: has no metadata 'own'")
    counts = {n: np.zeros(6) for n in SHOWN}
    by_kind = {kind: np.zeros((len(SHOWN), 2)) for kind in PERFORMED}
    for seed in range(people):
        every = list(done(model, seed, level))
        for kind in PERFORMED:
            mine = [one for one in every if one.kind == kind]
            if len(mine) < TRIALS - 2:
                continue
            for n, count in counts.items():
                if any(one.claimed for one in mine[:n]):
                    continue
                prototypes = {kind: Prototype.of(space, np.stack([one.place for one in mine[:n]]))}
                sets = (
                    mine[EXAMPLES:],
                    [one for one in every if one.kind in NON_GESTURES and one.kind != kind],
                    [one for one in every if one.kind in GESTURES],
                )
                found = np.concatenate([taken(space, prototypes, chosen) for chosen in sets])
                count += found
                by_kind[kind][SHOWN.index(n)] += found[:2]
    print(f"{level}: {'examples':<10}{'recall':>10}{'others accepted':>18}{'built-in taken':>18}")
    for n, count in counts.items():
        recall, others, built_in = count[0::2] / np.maximum(count[1::2], 1)
        print(f"{'':{len(level) + 2}}{n:<10}{recall:>10.3f}{others:>18.4f}{built_in:>18.4f}")
    for kind, each in by_kind.items():
        shares = [f"{right / asked:.2f} of {asked:.0f}" if asked else "refused" for right, asked in each]
        print(f"{'':{len(level) + 2}}{kind:<22}" + "".join(f"{share:>14}" for share in shares))


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="cnn_lstm", help="a shipped name or a path (cnn_lstm)")
    parser.add_argument("--people", type=int, default=10, help="people (10)")
    parser.add_argument("--level", nargs="+", default=["nominal"], choices=LEVELS, help="how hard (nominal)")
    args = parser.parse_args()
    model = open_model(args.model)
    for level in args.level:
        judge(model, args.people, level)


if __name__ == "__main__":
    main()
