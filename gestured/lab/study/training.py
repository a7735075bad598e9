"""The study's networks, and one trainer for all: a fixed number of batches, so that more data does not train longer.

All answer after a given frame of each window; what comes later changes nothing, by construction (a recurrent layer is
causal). The paper gives the LSTM's widths (81, 32, 10) and the kinds of layers; the convolutions' widths are left open:
ours are 8 and 16 channels of 3 x 3.

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

from gestured.lab.fit import LONGEST, optimiser_of, padded, similar, step
from gestured.lab.nets import SCALE, last_active
from gestured.lab.samples import Samples

SENSOR_SIDE = 9


def convolutions(channels: int) -> nn.Sequential:
    """Two convolutions with ReLU and max-pooling, the paper's CNN-LSTM's: (N, 1, R, C) -> (N, 8 * channels)."""
    layers = nn.Sequential(
        nn.Conv2d(1, channels, 3, padding=1), nn.ReLU(), nn.MaxPool2d(2, ceil_mode=True),
        nn.Conv2d(channels, 2 * channels, 3, padding=1), nn.ReLU(), nn.MaxPool2d(2), nn.Flatten(),
    )  # fmt: skip
    return layers.to(memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return]  # a quarter faster


class SequenceNet(nn.Module):
    """The taxels of each frame, or convolutions of them; LSTM or GRU over the frames; a linear head read at one frame.

    `kind` is lstm, cnn_lstm or cnn_gru.
    """

    def __init__(self, kind: str, units: int, classes: int, channels: int = 0) -> None:
        super().__init__()
        convolved = kind.startswith("cnn_")
        self.encoder = convolutions(channels) if convolved else nn.Flatten()
        inputs = 8 * channels if convolved else SENSOR_SIDE * SENSOR_SIDE
        if kind.endswith("lstm"):
            self.temporal: nn.RNNBase = nn.LSTM(inputs, units, batch_first=True)
            with torch.no_grad():  # remember by default (Jozefowicz et al. 2015), as in the shipped models
                dict(self.temporal.named_parameters())["bias_hh_l0"][units : 2 * units] += 1.0
        else:
            self.temporal = nn.GRU(inputs, units, batch_first=True)
        self.head = nn.Linear(units, classes)

    def forward(self, x: Tensor, at: Tensor) -> Tensor:
        """(B, T, R, C), (B,) index of the frame to answer after -> (B, classes) logits."""
        batch, time = x.shape[0], x.shape[1]
        seen = self.encoder(SCALE * x.reshape(-1, 1, x.shape[2], x.shape[3])).reshape(batch, time, -1)
        states = self.temporal(seen)[0]
        logits: Tensor = self.head(states.gather(1, at[:, None, None].expand(-1, 1, states.shape[2]))[:, 0])
        return logits


class Answering(nn.Module):
    """A sequence net as the daemon runs it: probabilities at the last frame with contact, and nothing rejected."""

    def __init__(self, net: nn.Module) -> None:
        super().__init__()
        self.net = net

    def forward(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """(B, T, R, C) -> scores (B, G), unknown (B,)."""
        scores = self.net(frames, last_active(frames)).softmax(1)
        return scores, 0.0 * scores[:, 0]


class HistoryNet(nn.Module):
    """The paper's CNN on motion history images: four convolutions with leaky ReLU, two fully connected layers.

    Left open by the paper: widths (ours: `channels` twice, twice as many twice, 64 units), and where it pools (ours:
    after the second convolution).
    """

    def __init__(self, classes: int, channels: int) -> None:
        super().__init__()
        wide = 2 * channels
        self.layers = nn.Sequential(
            nn.Conv2d(1, channels, 3, padding=1), nn.LeakyReLU(), nn.Conv2d(channels, channels, 3, padding=1),
            nn.LeakyReLU(), nn.MaxPool2d(2, ceil_mode=True), nn.Conv2d(channels, wide, 3, padding=1), nn.LeakyReLU(),
            nn.Conv2d(wide, wide, 3, padding=1), nn.LeakyReLU(), nn.Flatten(),
            nn.Linear(wide * 25, 64), nn.LeakyReLU(), nn.Linear(64, classes),
        )  # fmt: skip

    def forward(self, x: Tensor) -> Tensor:
        """(B, R, C) images -> (B, classes) logits."""
        logits: Tensor = self.layers(x[:, None])
        return logits


BATCH_SEQUENCES = 64
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Windows:
    """Windows, the inputs of a sequence net."""

    samples: Samples
    to_the_end: bool  # read after the last frame, padding included, and not after the last one with contact

    def batch(self, index: Indices) -> tuple[Tensor, Tensor]:
        """(B, T, R, C) windows, (B,) frames to answer after."""
        x = padded(self.samples, index, LONGEST)
        return x, torch.full((len(index),), x.shape[1] - 1) if self.to_the_end else last_active(x)

    def order(self, index: Indices, rng: np.random.Generator) -> Indices:
        """`index` in random order, but so that neighbours are of similar length."""
        return np.concatenate(list(similar(self.samples, index, BATCH_SEQUENCES, rng)))


@dataclass(frozen=True)
class Images:
    """Images, the inputs of the net on motion history images."""

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
        order = np.arange(len(index))
        if isinstance(inputs, Windows):  # windows of similar length share a batch, so that little is padded
            order = np.argsort(inputs.samples.lengths()[index], kind="stable")
        batches = (inputs.batch(index[order[i : i + 256]]) for i in range(0, len(index), 256))
        with torch.no_grad():
            found = np.concatenate([self.module(*batch).softmax(1).numpy() for batch in batches]).astype(np.float64)
        return found[np.argsort(order, kind="stable")]


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
