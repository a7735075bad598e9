"""The networks: CNN-LSTM and LSTM of the paper, the trajectory net that checks them, and how they decide together.

All take windows (B, T, R, C) float32, 0..1, at the model's grid and rate. Every answer is taken one frame after the
last active one: an idle frame there says that the gesture is over, and more of them change nothing by construction. A
window that ends in an active frame is answered as a gesture that goes on. In a batch that is padded, `lengths` (B,) are
the true numbers of frames; without `lengths` no window is padded.
"""

import torch
from torch import Tensor, nn

from gestured.model.features import ACTIVE

UNITS = 32  # of an LSTM
HIDDEN = 160  # units of each hidden layer of the perceptron
SCALE = 3.0  # windows are mostly zeros: without it the first layers hardly move


def active_frames(x: Tensor) -> Tensor:
    """(B, T, R, C) -> (B, T) 1.0 where something is pressed."""
    return (x.flatten(2).amax(2) >= ACTIVE).to(x.dtype)


def last_active(x: Tensor) -> Tensor:
    """(B, T, R, C) -> (B,) int64 index of the last frame with contact, 0 if there is none."""
    index = torch.arange(x.shape[1], dtype=x.dtype, device=x.device)
    return (active_frames(x) * index).amax(1).to(torch.int64)


def read_at(x: Tensor, lengths: Tensor | None = None) -> Tensor:
    """(B, T, R, C) -> (B,) int64 index of the frame after the last active one, or of the last frame."""
    end = x.shape[1] if lengths is None else lengths
    return (last_active(x) + 1).clamp(max=end - 1)


class Opinion(nn.Module):
    """A network: windows -> a state -> logits. Without `lengths` no window of a batch is padded."""

    def embed(self, x: Tensor, lengths: Tensor | None = None) -> Tensor:
        """(B, T, R, C) -> (B, units): the state that the head sees."""
        raise NotImplementedError

    def judge(self, state: Tensor) -> Tensor:
        """(B, units) -> (B, classes) logits."""
        raise NotImplementedError

    def forward(self, x: Tensor, lengths: Tensor | None = None) -> Tensor:
        """(B, T, R, C) -> (B, classes) logits."""
        return self.judge(self.embed(x, lengths))


class Recurrent(Opinion):
    """An LSTM of 32 units over per-frame features, read at `read_at`, and a linear head."""

    def __init__(self, inputs: int, classes: int, units: int = UNITS) -> None:
        super().__init__()
        self.lstm = nn.LSTM(inputs, units, batch_first=True)
        with torch.no_grad():  # remember by default (Jozefowicz et al. 2015): a gesture's beginning decides its name
            dict(self.lstm.named_parameters())["bias_hh_l0"][units : 2 * units] += 1.0
        self.head = nn.Linear(units, classes)

    def features(self, x: Tensor) -> Tensor:
        """(B, T, R, C) -> (B, T, inputs); the whole frame, flattened."""
        return SCALE * x.flatten(2)

    def embed(self, x: Tensor, lengths: Tensor | None = None) -> Tensor:
        """(B, T, R, C) -> (B, units): the state at `read_at`."""
        states: Tensor = self.lstm(self.features(x))[0]
        index = read_at(x, lengths)[:, None, None].expand(-1, 1, states.shape[2])
        return states.gather(1, index)[:, 0]

    def judge(self, state: Tensor) -> Tensor:
        """(B, units) -> (B, classes) logits."""
        logits: Tensor = self.head(state)
        return logits


class Lstm(Recurrent):
    """The paper's LSTM: 81 inputs, 32 units."""

    def __init__(self, rows: int, columns: int, classes: int) -> None:
        super().__init__(rows * columns, classes)


class CnnLstm(Recurrent):
    """The paper's CNN-LSTM: two convolutions with ReLU and max-pooling on each frame, then the LSTM."""

    def __init__(self, rows: int, columns: int, classes: int) -> None:
        size = -(-rows // 2) // 2 * (-(-columns // 2) // 2)
        super().__init__(32 * size, classes)
        self.convolutions = nn.Sequential(
            nn.Conv2d(1, 16, 3, padding=1), nn.ReLU(), nn.MaxPool2d(2, ceil_mode=True),
            nn.Conv2d(16, 32, 3, padding=1), nn.ReLU(), nn.MaxPool2d(2),
        )  # fmt: skip

    def features(self, x: Tensor) -> Tensor:
        """(B, T, R, C) -> (B, T, 32 * cells left after pooling)."""
        batch, time = x.shape[0], x.shape[1]
        y: Tensor = self.convolutions(SCALE * x.reshape(-1, 1, x.shape[2], x.shape[3]))
        return y.reshape(batch, time, -1)


class Standardising(nn.Module):
    """A net whose inputs are standardised first; the scaling is part of it."""

    mean: Tensor
    scale: Tensor

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(inputs))
        self.register_buffer("scale", torch.ones(inputs))

    def fit_scale(self, values: Tensor) -> None:
        """Learn the standardisation from (N, inputs)."""
        self.mean.copy_(values.mean(0))
        self.scale.copy_(values.std(0).clamp(min=1e-3))

    def standardised(self, values: Tensor) -> Tensor:
        """(B, inputs) -> (B, inputs), standardised and bounded."""
        return ((values - self.mean) / self.scale).clamp(-6, 6)


class Perceptron(Standardising):
    """A small feed-forward net on features."""

    def __init__(self, inputs: int, classes: int) -> None:
        super().__init__(inputs)
        self.layers = nn.Sequential(
            nn.Linear(inputs, HIDDEN), nn.ReLU(), nn.Dropout(0.1),
            nn.Linear(HIDDEN, HIDDEN), nn.ReLU(), nn.Dropout(0.1),
            nn.Linear(HIDDEN, classes),
        )  # fmt: skip

    def embed(self, features: Tensor) -> Tensor:
        """(B, inputs) -> (B, HIDDEN): the last hidden layer."""
        hidden: Tensor = self.layers[:-1](self.standardised(features))
        return hidden

    def forward(self, features: Tensor) -> Tensor:
        """(B, inputs) -> (B, classes) logits."""
        logits: Tensor = self.layers[-1](self.embed(features))
        return logits


class Decision(nn.Module):
    """Combines two opinions into calibrated scores and the probability of no gesture.

    `first` and `second` give logits over G gestures and further classes of non-gestures. The scores are a softmax over
    the weighted sum of both (temperature scaling of each, Guo et al. 2017). The rejection is a logistic regression on
    both opinions' log-odds of no gesture, on how far they agree and on how sure they are.
    """

    CUES = 6
    share: Tensor
    weight: Tensor
    bias: Tensor

    def __init__(self, gestures: int) -> None:
        super().__init__()
        self.gestures = gestures
        self.register_buffer("share", torch.tensor([0.5, 0.5]))
        self.register_buffer("weight", torch.zeros(self.CUES))
        self.register_buffer("bias", torch.zeros(()))

    def cues(self, first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
        """(B, K) and (B, K) logits -> (B, G) log scores, (B, CUES) cues of a non-gesture, bounded."""
        g = self.gestures
        one, two = first.log_softmax(1), second.log_softmax(1)
        scores = (self.share[0] * one[:, :g] + self.share[1] * two[:, :g]).log_softmax(1)
        best = scores.argmax(1, keepdim=True)
        cues = [
            one[:, g:].logsumexp(1) - one[:, :g].logsumexp(1),
            two[:, g:].logsumexp(1) - two[:, :g].logsumexp(1),
            -one.gather(1, best)[:, 0],
            -two.gather(1, best)[:, 0],
            -scores.gather(1, best)[:, 0],
            (one[:, :g].softmax(1) - two[:, :g].softmax(1)).abs().sum(1),
        ]
        return scores, torch.stack(cues, 1).clamp(-12, 12)

    def forward(self, first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
        """Logits of both -> scores (B, G), unknown (B,)."""
        scores, cues = self.cues(first, second)
        return scores.exp(), torch.sigmoid((cues * self.weight).sum(1) + self.bias)


class Verifier(Standardising):
    """Cues and states of both opinions, and the context of the segment -> log-odds that no gesture was meant."""

    def __init__(self, cues: int, embedding: int, context: int) -> None:
        inputs, units = cues + embedding + context, 64
        super().__init__(inputs)
        self.layers = nn.Sequential(nn.Linear(inputs, units), nn.ReLU(), nn.Dropout(0.2), nn.Linear(units, 1))

    def forward(self, cues: Tensor, embedding: Tensor, context: Tensor) -> Tensor:
        """(B, cues), (B, E), (B, K) -> (B,) log-odds that no gesture was meant."""
        logit: Tensor = self.layers(self.standardised(torch.cat([cues, embedding, context], 1)))
        return logit[:, 0]


class Judged(nn.Module):
    """The exported module: a recurrent net, the trajectory net as its second opinion, and the decision."""

    def __init__(self, net: Opinion, trajectory: Opinion, decision: Decision, verifier: Verifier | None = None) -> None:
        super().__init__()
        self.net = net
        self.trajectory = trajectory
        self.decision = decision
        self.verifier = verifier

    def forward(self, frames: Tensor, context: Tensor | None = None) -> tuple[Tensor, Tensor, Tensor]:
        """(B, T, R, C), perhaps a context (B, K) -> scores (B, G) given a gesture, unknown (B,), embedding (B, E).

        The embedding is the input of the two heads: the recurrent net's state, then the trajectory net's hidden layer.
        A verifier decides `unknown` if there is one and a context is given.
        """
        state, hidden = self.net.embed(frames), self.trajectory.embed(frames)
        first, second = self.net.judge(state), self.trajectory.judge(hidden)
        embedding = torch.cat([state, hidden], 1)
        if self.verifier is None or context is None:
            return *self.decision(first, second), embedding
        scores, cues = self.decision.cues(first, second)
        return scores.exp(), torch.sigmoid(self.verifier(cues, embedding, context)), embedding
