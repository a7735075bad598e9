"""One trainer for every network: a fixed number of batches, so that augmented data is not trained on for longer.

AdamW with a one-cycle schedule, cross-entropy with a little smoothing. One thread, one seed: same seed, same numbers.
Sequences are padded to the longest of their batch and read at their own last frame with contact; under the paper's
protocol all are of equal length and are read at the very end, padding included.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gestured.lab.fit import LONGEST, optimiser_of, padded, step
from gestured.lab.nets import last_active
from gestured.lab.samples import Samples

BATCH_SEQUENCES = 64
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Windows:
    """What a sequence net learns from."""

    samples: Samples
    to_the_end: bool  # read after the last frame, padding included, and not after the last one with contact

    def batch(self, index: Indices) -> tuple[Tensor, Tensor]:
        """(B, T, R, C) windows, (B,) frames to answer after."""
        x = padded(self.samples, index, LONGEST)
        return x, torch.full((len(index),), x.shape[1] - 1) if self.to_the_end else last_active(x)

    def order(self, index: Indices, rng: np.random.Generator) -> Indices:
        """`index` in random order, but so that neighbours are of similar length."""
        lengths = self.samples.lengths()
        mixed = rng.permutation(index)
        pools = [mixed[i : i + 20 * BATCH_SEQUENCES] for i in range(0, len(mixed), 20 * BATCH_SEQUENCES)]
        return np.concatenate([pool[np.argsort(lengths[pool] + 3 * rng.random(len(pool)))] for pool in pools])


@dataclass(frozen=True)
class Images:
    """What the net on motion history images learns from."""

    images: NDArray[np.float32]  # (G, R, C)

    def batch(self, index: Indices) -> tuple[Tensor]:
        """The images of one batch: a tuple of one tensor (B, R, C)."""
        return (torch.from_numpy(self.images[index]),)

    def order(self, index: Indices, rng: np.random.Generator) -> Indices:
        """`index` in random order."""
        return rng.permutation(index)


Inputs = Windows | Images


@dataclass(frozen=True)
class Net:
    """A network that has been trained."""

    module: nn.Module

    def scores(self, inputs: Inputs, index: Indices) -> NDArray[np.float64]:
        """(n, K) probabilities of the chosen samples."""
        order = np.argsort(inputs.samples.lengths()[index], kind="stable") if isinstance(inputs, Windows) else None
        sorted_index = index if order is None else index[order]
        with torch.no_grad():
            parts = [
                self.module(*inputs.batch(sorted_index[i : i + 256])).softmax(1).numpy()
                for i in range(0, len(index), 256)
            ]
        found = np.concatenate(parts).astype(np.float64)
        return found if order is None else found[np.argsort(order, kind="stable")]


def train_net(
    make: Callable[[], nn.Module], inputs: Inputs, index: Indices, labels: Indices, steps: int, rate: float, seed: int
) -> Net:
    """Fit a fresh network to the samples `index` (their classes are labels[index]) in `steps` batches."""
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    module = make()
    optimiser, schedule = optimiser_of([module], [rate], 1e-2, max(steps, 11))
    criterion = nn.CrossEntropyLoss(label_smoothing=0.03)
    module.train()
    for _, chosen in zip(range(steps), _batches(inputs, index, np.random.default_rng(seed)), strict=False):
        loss = criterion(module(*inputs.batch(chosen)), torch.from_numpy(labels[chosen]))
        step(loss, module, optimiser, schedule, 1.0)
    return Net(module.eval())


def _batches(inputs: Inputs, index: Indices, rng: np.random.Generator) -> Iterator[Indices]:
    """Batches without end, each epoch in another order."""
    while True:
        order = inputs.order(index, rng)
        starts = np.arange(0, len(order), BATCH_SEQUENCES)
        for start in rng.permutation(starts):
            yield order[start : start + BATCH_SEQUENCES]
