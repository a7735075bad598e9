"""The networks of the study: what reads each frame, and what reads the frames in their order.

All take windows (B, T, R, C) float32 and answer after a given frame of each, (B,); what comes later changes nothing,
by construction (a recurrent layer is causal). The paper gives the LSTM's widths (81, 32, 10) and the kinds of
layers; the convolutions' widths are left open: ours are 16 and 32 channels of 3 x 3, as in the shipped models.
"""

import torch
from torch import Tensor, nn

from gestured.lab.nets import SCALE, last_active

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

    def __init__(self, kind: str, units: int, classes: int, channels: int = 16) -> None:
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
