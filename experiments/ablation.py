"""What each kind of simulated take brings: networks that learned without it, beside one that learned from all.

    python -m experiments.ablation --cache .cache/lab

Each is taught by as many takes of the wide stream in as many steps, a third of the takes and half of the epochs of the
shipped models, and calibrated without that kind as well. People whom none has met judge: on takes of that kind, and on
all others. Both networks are compared where they err as often: where no more gestures are wrong, and no more
non-gestures accepted, than of the one that learned from all.
"""

import argparse
from collections.abc import Callable
from functools import cache as remembered
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gestured.lab.adapt.judging import Answers
from gestured.lab.adapt.learning import opinions
from gestured.lab.cli import CACHE
from gestured.lab.dataset import simulated
from gestured.lab.fit import FitConfig
from gestured.lab.nets import Judged
from gestured.lab.samples import Samples
from gestured.lab.train import TrainingData, TrainingPlan, calibration_set, judged, learn
from gestured.simulator import wide_plan
from gestured.simulator.cohort import WideTake

NAME = "cnn_lstm"
NETS = (NAME, "trajectory")
TAKES = 20_000  # of the wide stream that teach, and of its seed 4 that judge
PLAN = TrainingPlan(fit=FitConfig(epochs=10))
KINDS: dict[str, Callable[[WideTake], bool]] = {
    "touches of at most 25 times the noise": lambda take: take.sensor.noise >= 1 / 25,
    "bursts that hit a whole row or column": lambda take: take.sensor.line_bursts_per_minute > 0,
    "each fourth to eleventh frame is lost": lambda take: take.sensor.loss_every > 0,
    "hurried strokes of two to four frames": lambda take: take.hurry > 1,
    "sensors like touchscreens": lambda take: (
        take.sensor.dtype == "uint8" and take.sensor.offset == 0 and take.sensor.force_exponent < 0.5
    ),
}


@remembered
def _takes(seed: int, count: int) -> tuple[NDArray[np.int64], dict[str, NDArray[np.bool_]]]:
    """(N,) people of the first takes of the stream, who perform one each, and of which kind each take is."""
    plans = [wide_plan(seed, index) for index in range(count)]
    people = np.array([plan.participant.seed for plan in plans], np.int64)
    return people, {kind: np.array([is_of(plan) for plan in plans], bool) for kind, is_of in KINDS.items()}


def of_kind(samples: Samples, seed: int, count: int, kind: str) -> NDArray[np.bool_]:
    """(G,) whether each sample of the first `count` takes of a seed is of that kind."""
    people, kinds = _takes(seed, count)
    order = np.argsort(people)
    return kinds[kind][order[np.searchsorted(people, samples.people, sorter=order)]]


def first(samples: Samples, takes: int) -> Samples:
    """The samples of the first so many takes."""
    _, at, take = np.unique(samples.people, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(at))
    return samples.take(rank[take] < takes)


def material(cache: Path, kind: str | None) -> TrainingData:
    """What teaches and calibrates, without takes of that kind."""
    parts = []
    for seed, count in ((1, PLAN.wide), (2, PLAN.wide_calibrate)):
        samples = simulated(cache, "wide", seed, count)
        parts.append(samples if kind is None else samples.take(~of_kind(samples, seed, count, kind)))
    return TrainingData(first(parts[0], TAKES), 0, parts[1], {}, {}, None)


def network(cache: Path, kind: str | None) -> tuple[Judged, float]:
    """A network that learned without that kind, None for one that learned from all; and its threshold."""
    data = material(cache, kind)
    trained = learn(PLAN, data, cache, NETS)
    module, calibration, _ = judged(trained, NAME, calibration_set(trained, data, PLAN))
    return module, calibration["threshold"]


def asked(model: Judged, samples: Samples) -> Answers:
    """What a network says of each sample."""
    return Answers.of(samples, opinions(model, samples).answers(model.decision, model.verifier), np.zeros(0, np.int64))


def row(title: str, every: Answers, without: Answers, least: float) -> str:
    """A line of the table: gestures named rightly by a network that knows the kind and by one that does not.

    The first publishes from a confidence of `least` on, the second from where it errs no more often.
    """
    before = every.shares(least)
    after = without.shares(without.least_for(before.wrong[0], before.accepted[0]))
    cells = [f"{before.wrong[0]:.3f}", f"{before.accepted[0]:.3f}"]
    cells += ["{:.3f} ({:.3f} to {:.3f})".format(*shares.right) for shares in (before, after)]
    return f"| {' | '.join([title, str(before.gestures), *cells])} |"


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, default=CACHE, help="of a training (%(default)s)")
    args = parser.parse_args()
    samples = first(simulated(args.cache, "wide", 4, PLAN.wide_early), TAKES)
    model, least = network(args.cache, None)
    everything = asked(model, samples)
    heads = ["left out", "judged on", "gestures", "wrong", "accepted", "right, learned from all", "right, without it"]
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}", flush=True)
    for kind in KINDS:
        model, _ = network(args.cache, kind)
        without, chosen = asked(model, samples), of_kind(samples, 4, PLAN.wide_early, kind)
        for title, rows in (("these", chosen), ("all others", ~chosen)):
            print(row(f"{kind} | {title}", everything.take(rows), without.take(rows), least), flush=True)


if __name__ == "__main__":
    main()
