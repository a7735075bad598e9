"""What a training run depends on beside its data: the seed, and the last digits of its windows.

A small set of simulated gestures and few epochs, with the very code that trains what ships; what is measured is by how
much two such runs differ, not how good they are.
"""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from gestured.lab.dataset import cuts
from gestured.lab.fit import NETS, FitConfig, logits, pretrain, targets
from gestured.lab.samples import Samples, collect, sample
from gestured.lab.stability.path import simulated_series
from gestured.lab.stability.ways import ScoreTable
from gestured.lab.table import Table, Value

TAUGHT, JUDGED = 11, 12  # seeds of the simulated people who are learned from, and who are judged
BATCH = 16  # so that a small set makes enough steps


def samples_of(count: int, seed: int) -> Samples:
    """So many simulated gestures as training stores them, float16."""
    found = enumerate(simulated_series(count, seed))
    return collect(sample(cut, kind, kind, k // 10) for k, (kind, s) in found for cut in cuts(s.frames, s.times))


def seeds_table(gestures: int, epochs: int) -> Table:
    """Runs that differ in one thing, each against the first, by network."""
    taught, judged = samples_of(gestures, TAUGHT), samples_of(gestures // 2, JUDGED)
    right = targets(judged)
    down: Any = np.nextafter(taught.frames.astype(np.float32), np.float32(0))
    moved = replace(taught, frames=down)
    plain = FitConfig(epochs=epochs, batch=BATCH)
    runs = {
        "the first, of seed 1": (taught, plain),
        "the same again": (taught, plain),
        "every number one step of float32 smaller": (moved, plain),
        "seed 2": (taught, replace(plain, seed=2)),
        "seed 3": (taught, replace(plain, seed=3)),
    }
    first: dict[str, ScoreTable] = {}
    rows: list[tuple[Value, ...]] = []
    for title, (some, config) in runs.items():
        for name, scores in _trained(some, judged, config).items():
            said = scores.argmax(axis=1)
            to = first.setdefault(name, scores)
            changed = int((said != to.argmax(axis=1)).sum())
            share = f"{100 * float((said == right).mean()):.1f} %"
            rows.append((name, title, float(np.abs(scores - to).max()), changed, share))
    return Table(
        "Seeds: two small trainings, largest change of any score",
        ("network", "run", "change", "labels changed", "named rightly"),
        sorted(rows, key=lambda row: NETS.index(str(row[0]))),
        (
            f"{len(taught)} simulated gestures, {epochs} epochs, judged on {len(judged)} of other people; against the",
            "first run. Scores are from 0 to 1, each network's own before it is calibrated.",
        ),
    )


def _trained(taught: Samples, judged: Samples, config: FitConfig) -> dict[str, ScoreTable]:
    """Each network's scores after training, on one thread."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with tempfile.TemporaryDirectory() as folder:
            nets = pretrain(taught, config, Path(folder) / "checkpoint.npz")
        return {name: found.softmax(dim=1).double().numpy() for name, found in logits(nets, judged).items()}
    finally:
        torch.set_num_threads(before)
