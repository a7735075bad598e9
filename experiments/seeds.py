"""How far the shipped network depends on its seed: its first stage, trained with other seeds; nothing ships from it.

    python -m experiments.seeds --document models/cnn_lstm.md

A further seed takes some 20 minutes of one core, and can be interrupted and continued. The first seed is that of the
model that ships: its network is taken from the cache of its training, in which two other networks were learned beside
it. A further seed's network is learned alone. All are judged before calibration, second opinion and real fingers: a
gesture is right if its score is the best among gestures; a non-gesture is rejected if the best of all scores is a
non-gesture's.
"""

from collections.abc import Sequence
from dataclasses import replace
from statistics import mean, stdev

import numpy as np
from torch import nn

from experiments.pages import add_document, tell
from experiments.trained import loaded, options
from gestured.lab.fit import NETS, logits, targets
from gestured.lab.table import Table, Value
from gestured.lab.train import TrainingData, learn
from gestured.simulator import GESTURES

NAME = "cnn_lstm"
SEEDS = (1, 2, 3)  # the first is the seed of the models that ship


def shares(nets: nn.ModuleDict, data: TrainingData) -> list[float]:
    """For each test set, the share of its gestures named rightly, and of its non-gestures rejected."""
    found: list[float] = []
    for test, samples in data.tests.items():
        scores, labels = logits(nets, samples)[NAME].numpy(), targets(samples)
        meant = (labels >= 0) & (labels < len(GESTURES))
        right = scores[meant, : len(GESTURES)].argmax(axis=1) == labels[meant]
        found += [float(right.sum()) / data.performed[test]]
        found += [float(np.mean(scores[~meant].argmax(axis=1) >= len(GESTURES)))]
    return found


def table(seeds: Sequence[int], found: Sequence[Sequence[float]], data: TrainingData) -> Table:
    """A row for each seed, then their mean and their standard deviation."""
    rows: list[tuple[Value, ...]] = [
        (f"seed {seed}", *(f"{share:.3f}" for share in one)) for seed, one in zip(seeds, found, strict=True)
    ]
    columns = list(zip(*found, strict=True))
    rows.append(("mean", *(f"{mean(column):.3f}" for column in columns)))
    if len(found) > 1:
        rows.append(("standard deviation (n - 1)", *(f"{stdev(column):.3f}" for column in columns)))
    head = [f"{test}: {what}" for test in data.tests for what in ("right\\*", "rejected")]
    note = (
        "The CNN-LSTM by itself after the first stage of its training, which has simulated people only: without second",
        "opinion, calibration and real fingers. Seed 1 is that of the model that ships; nothing else here ships.",
    )
    return Table("Other seeds", ("", *head), rows, note)


def main() -> None:
    """Learn with each seed, print and write the table."""
    parser = options(__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS, metavar="N", help="(default: 1 2 3)")
    add_document(parser, "seeds")
    args = parser.parse_args()
    # The first stage uses no days of the verifier or of the operating points, and nothing real.
    plan, data = loaded(args, days_calibrate=1, chance_calibrate=1, days_points=1)
    data = replace(data, real=None)
    found = []
    for seed in args.seeds:
        names = NETS if seed == plan.fit.seed else (NAME,)
        nets = learn(replace(plan, fit=replace(plan.fit, seed=seed)), data, args.cache, names).nets
        found.append(shares(nets, data))
        print(f"seed {seed}: {' '.join(f'{share:.3f}' for share in found[-1])}", flush=True)
    tell(table(args.seeds, found, data), [args.models / f"{NAME}.onnx"], "seeds", args.document)


if __name__ == "__main__":
    main()
