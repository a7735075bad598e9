"""How well enrolment works for simulated people and kinds of gesture from which nothing was learned.

python -m experiments.own models/cnn_lstm.onnx
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.pages import add_document, tell
from gestured.core.own import EXAMPLES
from gestured.lab.cli import CACHE
from gestured.lab.own.learn import Seen, Trial, embedding_of, played_through
from gestured.lab.own.play import JUDGED, played
from gestured.lab.table import Table
from gestured.model.prototypes import Space

JUDGES = 12  # people


@dataclass(frozen=True, slots=True)
class Figures:
    """How well enrolment works after a number of examples; shares."""

    examples: int
    enrolled: float  # gestures that can be enrolled; the others are too near to one of the model's
    recall: float  # further repetitions that are recognised
    accepted: float  # other non-gestures that are taken for the enrolled one
    taken: float  # the model's gestures that are taken for the enrolled one


def figures(space: Space, trials: Iterator[Trial]) -> list[Figures]:
    """The figures for each number of examples, by the thresholds and the margin of a space."""
    every = list(trials)
    found = []
    for count in range(1, EXAMPLES + 1):
        some = [trial for trial in every if trial.examples == count]
        fit = [trial for trial in some if trial.fits]

        def share(of: str, fit: list[Trial] = fit, least: float = space.thresholds[count - 1]) -> float:
            return float(np.concatenate([getattr(trial, of).taken(least, space.margin) for trial in fit]).mean())

        found.append(Figures(count, len(fit) / len(some), share("again"), share("others"), share("gestures")))
    return found


def table(name: str, found: list[Figures]) -> Table:
    """The figures as a table."""
    rows = [
        (one.examples, f"{one.enrolled:.3f}", f"{one.recall:.3f}", f"{one.accepted:.4f}", f"{one.taken:.4f}")
        for one in found
    ]
    head = ("examples", "can be enrolled", "recall", "others accepted", "built-in taken")
    return Table(f"{name}: kinds of gesture and people from whom nothing was learned", head, rows)


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path, metavar="MODEL", help="an .onnx file that learns own gestures")
    parser.add_argument("--cache", type=Path, default=CACHE, help="where finished steps are kept (%(default)s)")
    parser.add_argument("--people", type=int, default=JUDGES, help="who judge (%(default)s)")
    add_document(parser, "own")
    args = parser.parse_args()
    model = embedding_of(args.model)
    assert model.space is not None, f"{args.model}: is of a version that could not learn them"
    seen = Seen.by(model, played(args.cache, args.people, judge=True))
    trials = (trial for trial in played_through(seen, model.space) if trial.kind in JUDGED)
    made = table(args.model.stem, figures(model.space, trials))
    tell(made, [args.model], "own", args.document)


if __name__ == "__main__":
    main()
