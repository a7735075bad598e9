"""What enrolment is worth for simulated people and kinds of gesture from which nothing was learned.

python -m experiments.own models/cnn_lstm.onnx
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gestured.core.own import EXAMPLES
from gestured.lab.cli import CACHE
from gestured.lab.own.command import embedding_of
from gestured.lab.own.learn import Seen, Trial, played_through
from gestured.lab.own.play import played
from gestured.lab.own.signs import JUDGED
from gestured.model.prototypes import Space

JUDGES = 12  # people


@dataclass(frozen=True, slots=True)
class Figures:
    """What enrolment is worth after so many examples; shares."""

    examples: int
    enrolled: float  # of the gestures: the others are refused as too near to one of the model's
    recall: float  # further repetitions that are recognised
    accepted: float  # other non-gestures that are taken for it
    taken: float  # the model's gestures that are taken for it


def figures(space: Space, trials: Iterator[Trial]) -> list[Figures]:
    """For each number of examples, with the thresholds and the margin of a space."""
    every = list(trials)
    found = []
    for count in range(1, EXAMPLES + 1):
        some = [trial for trial in every if trial.examples == count]
        fit = [trial for trial in some if trial.fits]

        def share(of: str, fit: list[Trial] = fit, least: float = space.thresholds[count - 1]) -> float:
            return float(np.concatenate([getattr(trial, of).taken(least, space.margin) for trial in fit]).mean())

        found.append(Figures(count, len(fit) / len(some), share("again"), share("others"), share("gestures")))
    return found


def table(name: str, found: list[Figures]) -> str:
    """The figures for a person."""
    head = f"{'examples':<10}{'can be enrolled':>17}{'recall':>10}{'others accepted':>17}{'built-in taken':>17}"
    lines = [f"{name}: gestures that nobody has enrolled before, of people whom nothing was learned from", head]
    lines += [
        f"{one.examples:<10}{one.enrolled:>17.3f}{one.recall:>10.3f}{one.accepted:>17.4f}{one.taken:>17.4f}"
        for one in found
    ]
    return "\n".join(lines)


def main() -> None:
    """Print a table for each model."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", type=Path, nargs="+", metavar="MODEL", help="that gestured-lab own has taught")
    parser.add_argument("--cache", type=Path, default=CACHE, help="where finished steps are kept (%(default)s)")
    parser.add_argument("--people", type=int, default=JUDGES, help="who judge (%(default)s)")
    args = parser.parse_args()
    for path in args.models:
        model = embedding_of(path)
        assert model.space is not None, f"{path}: teach it first: gestured-lab own {path}"
        seen = Seen.by(model, played(args.cache, args.people, judge=True))
        trials = (trial for trial in played_through(seen, model.space) if trial.kind in JUDGED)
        print(table(path.stem, figures(model.space, trials)), flush=True)


if __name__ == "__main__":
    main()
