"""The networks of the study: what reads each frame, and what reads the frames in their order.

All take windows (B, T, R, C) float32 and answer after a given frame of each, (B,); what comes later changes nothing,
by construction (every temporal part is causal). The paper gives the LSTM's widths (81, 32, 10) and the kinds of
layers; the convolutions' widths are left open: ours are 16 and 32 channels of 3 x 3, as in the shipped models.
"""

import math

import torch
import torch.nn.functional as F
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


class CausalConvolutions(nn.Module):
    """A temporal convolutional network (Bai et al. 2018): residual blocks, dilations 1 to 8; it sees 31 frames."""

    DILATIONS = (1, 2, 4, 8)

    def __init__(self, inputs: int, units: int) -> None:
        super().__init__()
        self.first = nn.Conv1d(inputs, units, 1)
        self.blocks = nn.ModuleList(nn.Conv1d(units, units, 3, dilation=d) for d in self.DILATIONS)

    def forward(self, x: Tensor) -> Tensor:
        """(B, T, inputs) -> (B, T, units)."""
        y: Tensor = self.first(x.transpose(1, 2))
        for dilation, block in zip(self.DILATIONS, self.blocks, strict=True):
            y = y + F.relu(block(F.pad(y, (2 * dilation, 0))))
        return y.transpose(1, 2)


class SelfAttention(nn.Module):
    """Causal multi-head attention (Vaswani et al. 2017), written out: torch's own freezes its length in ONNX."""

    HEADS = 4

    def __init__(self, units: int) -> None:
        super().__init__()
        self.inward, self.outward = nn.Linear(units, 3 * units), nn.Linear(units, units)

    def forward(self, x: Tensor) -> Tensor:
        """(B, T, units) -> (B, T, units)."""
        batch, time, units = x.shape
        parts = self.inward(x).reshape(batch, time, 3, self.HEADS, units // self.HEADS).permute(2, 0, 3, 1, 4)
        query, key, value = parts[0], parts[1], parts[2]  # (B, heads, T, units / heads)
        weight = query @ key.transpose(2, 3) / math.sqrt(units // self.HEADS)
        later = torch.ones(time, time, dtype=torch.bool).triu(1)
        seen = weight.masked_fill(later, -1e9).softmax(3) @ value
        out: Tensor = self.outward(seen.transpose(1, 2).reshape(batch, time, units))
        return out


class Attention(nn.Module):
    """A small transformer: two pre-norm layers, learned places in time."""

    LONGEST = 128  # frames; later ones share the last place

    def __init__(self, inputs: int, units: int) -> None:
        super().__init__()
        self.first = nn.Linear(inputs, units)
        self.places = nn.Parameter(0.02 * torch.randn(self.LONGEST, units))
        self.layers = nn.ModuleList(
            part
            for _ in range(2)
            for part in (
                nn.Sequential(nn.LayerNorm(units), SelfAttention(units)),
                nn.Sequential(nn.LayerNorm(units), nn.Linear(units, 2 * units), nn.GELU(), nn.Linear(2 * units, units)),
            )
        )
        self.norm = nn.LayerNorm(units)

    def forward(self, x: Tensor) -> Tensor:
        """(B, T, inputs) -> (B, T, units)."""
        y = self.first(x) + self.places[torch.arange(x.shape[1]).clamp(max=self.LONGEST - 1)]
        for layer in self.layers:
            y = y + layer(y)
        out: Tensor = self.norm(y)
        return out


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
    """`kind` is lstm, cnn_lstm, cnn_gru, tcn or transformer."""
    convolved = kind.startswith("cnn_")
    encoder = Convolutions(channels) if convolved else Flat()
    inputs = encoder.width
    temporal: nn.Module
    if kind == "tcn":
        temporal = CausalConvolutions(inputs, units)
    elif kind == "transformer":
        temporal = Attention(inputs, units)
    else:
        temporal = RecurrentNet(inputs, units, kind.removeprefix("cnn_"))
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
