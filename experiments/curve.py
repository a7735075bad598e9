"""How far `gestured-lab adapt` goes from a simulation towards real people, by the number of people that it is given.

    python -m experiments.curve --cache .cache/lab --real FOLDER

The base is the network that `gestured-lab train` had before it saw anybody real. It is taken from the cache of a
training, and so are the networks that each left out a third of the real subjects. The subjects that such a network has
not seen judge the base, the base adapted with some of the other subjects, and the network itself.
"""

import argparse
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from gestured.lab.adapt.adaptation import Answers, Interval, Shares, settled
from gestured.lab.adapt.learning import Course, opinions, simulate
from gestured.lab.adapt.material import Own, own_recordings
from gestured.lab.cli import CACHE
from gestured.lab.evaluate import without
from gestured.lab.nets import Judged
from gestured.lab.train import REAL_FILES, Trained, TrainingPlan, calibration_set, folds, judged, learn, load_data

NAME = "cnn_lstm"
PEOPLE = (1, 2, 4, 6)  # numbers of people with whom a model is adapted
BASE, SHIPPED = "nobody (simulation alone)", "shipped model's training"
WRONG = 0.01  # share of wrong answers at which all are compared, besides that of the base


def of_people(own: Own, chosen: NDArray[np.int64]) -> Own:
    """The part of `own` that is of the people `chosen`."""
    rows, lost = np.isin(own.samples.people, chosen), np.isin(own.missed[:, 0], chosen)
    return replace(own, samples=own.samples.take(rows), sittings=own.sittings[rows], missed=own.missed[lost])


@dataclass
class Said:
    """The answers of a model, or of one model for each group of people, to all people that judge it."""

    every: list[Answers] = field(default_factory=list)
    published: list[Answers] = field(default_factory=list)  # confidence 1 from the model's own threshold on, else 0

    def add(self, model: Judged, least: float, judges: Own) -> None:
        """Add the answers of a model that publishes from a confidence of `least` on."""
        said = opinions(model, judges.samples).answers(model.decision, model.verifier)
        self.take(Answers.of(judges.samples, said, judges.missed[:, 0]), least)

    def take(self, found: Answers, least: float) -> None:
        """Add the answers to one group of people."""
        self.every.append(found)
        self.published.append(replace(found, confidence=(found.confidence >= least).astype(np.float64)))

    def shares(self) -> Shares:
        """The shares at the model's own threshold."""
        return together(self.published).shares(0.5)

    def right_at(self, wrong: float) -> Interval:
        """The share of right answers at the threshold at which the share `wrong` is wrong."""
        every = together(self.every)
        return every.shares(every.least_for(wrong)).right


def together(parts: list[Answers]) -> Answers:
    """The answers to all groups, as one."""
    names = [one.name for one in fields(Answers)]
    return Answers(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def table(said: dict[str, Said]) -> str:
    """A row for each model, in Markdown; the first one is the base."""
    own = {name: one.shares() for name, one in said.items()}
    first = next(iter(own.values()))
    levels = (first.wrong[0], WRONG)
    heads = ["adapted with", "right", "wrong", "others accepted", *(f"right at {level:.3f} wrong" for level in levels)]
    lines = [heads, ["---"] * len(heads)]
    for name, shares in own.items():
        cells = [shares.right, shares.wrong, shares.accepted, *(said[name].right_at(level) for level in levels)]
        lines.append([name, *("{:.3f} ({:.3f} to {:.3f})".format(*cell) for cell in cells)])
    people = len(np.unique(together(next(iter(said.values())).every).unit))
    foot = f"{people} people with {first.gestures} gestures and {first.others} non-gestures; 95 % intervals over people"
    return "\n".join([*(f"| {' | '.join(line)} |" for line in lines), foot])


def main() -> None:
    """Print the table after each group of people."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, default=CACHE, help="of a training (%(default)s)")
    parser.add_argument("--real", type=Path, required=True, metavar="FOLDER", help="of the real recordings")
    args = parser.parse_args()
    torch.set_num_threads(1)
    plan, course = TrainingPlan(), Course()
    data = load_data(plan, args.cache, args.real, 2)
    assert data.real is not None, f"{args.real}: expected {' and '.join(REAL_FILES)}"
    alone = replace(data, real=None)
    simulated = learn(plan, alone, args.cache)  # the stage before real people, which all networks share
    base, calibration, _ = judged(simulated, NAME, calibration_set(simulated, alone))
    trained = learn(plan, data, args.cache)
    calibrated = calibration_set(trained, data)
    takes = simulate(args.cache, 2)
    own = own_recordings([args.real / REAL_FILES[0]])  # the sessions hold the same touches again
    subjects = np.array([int(name) for name in own.names])
    said: dict[str, Said] = {name: Said() for name in (BASE, *(f"{count} people" for count in PEOPLE), SHIPPED)}
    for k, held in enumerate(folds(data.real)):
        left_out = np.isin(subjects, data.real.people[held])
        judges, others = of_people(own, np.flatnonzero(left_out)), np.flatnonzero(~left_out)
        said[BASE].add(base, calibration["threshold"], judges)
        for count in PEOPLE:
            found = settled(base, calibration["threshold"], of_people(own, others[:count]), takes, course)
            said[f"{count} people"].add(found.judged, found.least, judges)
        module, seen, _ = judged(Trained(trained.folds[k], None), NAME, without(calibrated, data.real, held))
        said[SHIPPED].add(module, seen["threshold"], judges)
        print(table(said), flush=True)  # of the groups so far


if __name__ == "__main__":
    main()
