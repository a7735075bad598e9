"""The networks of the study: what reads each frame, and what reads the frames in their order.

All take windows (B, T, R, C) float32 and answer after a given frame of each, (B,); what comes later changes nothing,
by construction (a recurrent layer is causal). The paper gives the LSTM's widths (81, 32, 10) and the kinds of
layers; the convolutions' widths are left open: ours are 16 and 32 channels of 3 x 3, as in the shipped models.
"""

import torch
from torch import Tensor, nn

from gestured.lab.nets import SCALE

SENSOR_SIDE = 9


class Flat(nn.Module):
    """The frame's 81 taxels as they are."""

    width = SENSOR_SIDE * SENSOR_SIDE

    def forward(self, x: Tensor) -> Tensor:
        """(N, 1, R, C) -> (N, R * C)."""
        return x.flatten(1)


class Convolutions(nn.Module):
    """Two convolutions with ReLU and max-pooling (the paper's CNN-LSTM)."""

    def __init__(self, channels: int = 16) -> None:
        super().__init__()
        self.width = 2 * channels * 4
        self.layers = nn.Sequential(
            nn.Conv2d(1, channels, 3, padding=1), nn.ReLU(), nn.MaxPool2d(2, ceil_mode=True),
            nn.Conv2d(channels, 2 * channels, 3, padding=1), nn.ReLU(), nn.MaxPool2d(2),
        )  # fmt: skip

    def forward(self, x: Tensor) -> Tensor:
        """(N, 1, R, C) -> (N, width)."""
        y: Tensor = self.layers(x)
        return y.flatten(1)


class RecurrentNet(nn.Module):
    """LSTM or GRU over the frames."""

    def __init__(self, inputs: int, units: int, kind: str) -> None:
        super().__init__()
        self.cell = (
            nn.LSTM(inputs, units, batch_first=True) if kind == "lstm" else nn.GRU(inputs, units, batch_first=True)
        )
        if kind == "lstm":
            with torch.no_grad():  # remember by default (Jozefowicz et al. 2015), as in the shipped models
                dict(self.cell.named_parameters())["bias_hh_l0"][units : 2 * units] += 1.0

    def forward(self, x: Tensor) -> Tensor:
        """(B, T, inputs) -> (B, T, units)."""
        states: Tensor = self.cell(x)[0]
        return states


class SequenceNet(nn.Module):
    """A frame encoder, a temporal part, a linear head read at one frame."""

    def __init__(self, encoder: nn.Module, temporal: nn.Module, units: int, classes: int) -> None:
        super().__init__()
        self.encoder, self.temporal, self.head = encoder, temporal, nn.Linear(units, classes)

    def forward(self, x: Tensor, at: Tensor) -> Tensor:
        """(B, T, R, C), (B,) index of the frame to answer after -> (B, classes) logits."""
        batch, time = x.shape[0], x.shape[1]
        seen = self.encoder(SCALE * x.reshape(-1, 1, x.shape[2], x.shape[3])).reshape(batch, time, -1)
        states = self.temporal(seen)
        logits: Tensor = self.head(states.gather(1, at[:, None, None].expand(-1, 1, states.shape[2]))[:, 0])
        return logits


def sequence_net(kind: str, units: int, classes: int, channels: int = 16) -> SequenceNet:
    """`kind` is lstm, cnn_lstm or cnn_gru."""
    convolved = kind.startswith("cnn_")
    encoder = Convolutions(channels) if convolved else Flat()
    temporal = RecurrentNet(encoder.width, units, kind.removeprefix("cnn_"))
    encoder.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # a quarter faster
    return SequenceNet(encoder, temporal, units, classes)


class HistoryNet(nn.Module):
    """The paper's CNN on motion history images: four convolutions with leaky ReLU, two fully connected layers.

    Left open by the paper: widths (ours: `channels` twice, twice as many twice, 64 units), and where it pools (ours:
    after the second convolution).
    """

    def __init__(self, classes: int, channels: int = 16) -> None:
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
