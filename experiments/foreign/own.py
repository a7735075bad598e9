"""Judge own gestures on the independent generator: each person enrols kinds that no model has learned from it.

    python -m experiments.foreign.own --model cnn_lstm --people 10

That generator performs a kind in any way at all (a zigzag in any direction), which is harder than a person who repeats
a movement. So the figures are reported, not promised. Recall by kind shows which kinds are alike each time.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from experiments.foreign import GESTURES, LEVELS, NON_GESTURES
from experiments.foreign.hands import Performance, draw_person, perform
from experiments.foreign.sensors import draw_sensor, record
from experiments.pages import add_document, tell
from gestured.core.classifier import NEAR
from gestured.core.frames import Segment
from gestured.core.own import EXAMPLES
from gestured.lab.dataset import cuts
from gestured.lab.table import Table
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.own import Placed
from gestured.model.prototypes import Array, Prototype, Space, nearest
from gestured.model.shipped import LADDER, shipped

PERFORMED = (
    "long_press", "scribble", "zigzag", "pinch", "two_finger_tap", "check_mark", "two_finger_sideways",
    "diagonal_swipe",
)  # fmt: skip
TRIALS = EXAMPLES + 4  # of each kind
OTHER_TRIALS = 4
SHOWN = (1, 3, 5)  # numbers of examples


@dataclass(frozen=True)
class Seen:
    """One segment: what was performed, its place in the model's space, and what the model answers."""

    kind: str
    place: Array
    known: bool
    claimed: bool  # it would be refused as an example


def segments(performed: Performance, sensor: object, rng: np.random.Generator) -> list[Segment]:
    """The segments that the front end cuts out of one performance."""
    start = 1.4 + float(rng.uniform(0.0, 0.4))
    frames, times, _ = record(sensor, rng, [(start, performed)], start + performed.duration + 1.4)
    return cuts(frames, times)


def done(model: Model, seed: int, level: str) -> Iterator[Seen]:
    """The first segment of each thing that one person does at one sheet."""
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
    """(2,) how many chosen segments are answered with an own gesture, and how many there are."""
    matches = [(one, nearest(space, prototypes, one.place)) for one in chosen]
    own = [match and match.confidence >= NEAR and (not one.known or match.nearer) for one, match in matches]
    return np.array([sum(map(bool, own)), len(own)], np.float64)


def judge(model: Model, people: int, level: str) -> Table:
    """Recall by kind and number of examples, how many people could enrol each kind, and what else is taken for it."""
    space = model.space
    if space is None:
        raise SystemExit(f"{model.name}: has no metadata 'own'")
    counts = np.zeros((len(SHOWN), len(PERFORMED), 6))
    enrolled, tried = np.zeros(len(PERFORMED), int), np.zeros(len(PERFORMED), int)
    for seed in range(people):
        every = list(done(model, seed, level))
        for k, kind in enumerate(PERFORMED):
            mine = [one for one in every if one.kind == kind]
            if len(mine) < TRIALS - 2:
                continue
            tried[k] += 1
            enrolled[k] += not any(one.claimed for one in mine[:EXAMPLES])
            for row, n in enumerate(SHOWN):
                if any(one.claimed for one in mine[:n]):
                    continue
                prototypes = {kind: Prototype.of(space, np.stack([one.place for one in mine[:n]]))}
                sets = (
                    mine[EXAMPLES:],
                    [one for one in every if one.kind in NON_GESTURES and one.kind != kind],
                    [one for one in every if one.kind in GESTURES],
                )
                counts[row, k] += np.concatenate([taken(space, prototypes, chosen) for chosen in sets])
    recall, others, built_in = (counts[:, :, 2 * k] for k in range(3))
    asked = np.maximum(counts[:, :, 1::2], 1)
    names = [(kind, f"{enrolled[k]} of {tried[k]}", recall[:, k] / asked[:, k, 0]) for k, kind in enumerate(PERFORMED)]
    every_kind = counts.sum(axis=1)
    names.append(("all", f"{enrolled.sum()} of {tried.sum()}", every_kind[:, 0] / np.maximum(every_kind[:, 1], 1)))
    rows = [(name, of, *(f"{share:.2f}" for share in shares)) for name, of, shares in names]
    most = [float((part.sum(axis=1) / np.maximum(every_kind[:, 2 * k + 1], 1)).max())
            for k, part in ((1, others), (2, built_in))]  # fmt: skip
    note = f"Others accepted: {most[0]:.4f} at most; the model's gestures taken for it: {most[1]:.4f} at most."
    head = ("kind", f"enrolled from {EXAMPLES}", *(f"recall from {n}" for n in SHOWN))
    return Table(f"Other hands and sensors, {level}", head, rows, (note,))


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="cnn_lstm", choices=LADDER, help="a shipped one (cnn_lstm)")
    parser.add_argument("--people", type=int, default=10, help="people (10)")
    parser.add_argument("--level", default=LEVELS[0], choices=LEVELS, help=f"how hard ({LEVELS[0]})")
    add_document(parser, "other hands")
    args = parser.parse_args()
    table = judge(open_model(args.model), args.people, args.level)
    tell(table, [shipped()[args.model]], "other hands", args.document)


if __name__ == "__main__":
    main()
