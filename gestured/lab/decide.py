"""Calibration: how two opinions become probabilities, and from which confidence on a gesture is published.

All of it is fitted on people that the networks have not learned from.
"""

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gestured.lab.nets import Decision

LOST = 0.03  # share of the validation gestures that the threshold may cost


def fit_decision(first: Tensor, second: Tensor, labels: NDArray[np.int64], gestures: int) -> Decision:
    """Fit the shares (temperatures) and the rejection on logits (N, K) of both, classes (N,); >= gestures is none."""
    decision = Decision(gestures)
    y = torch.from_numpy(labels)
    known = (y >= 0) & (y < gestures)
    one, two = first.log_softmax(1)[known, :gestures], second.log_softmax(1)[known, :gestures]
    share = torch.tensor([0.0, 0.0], requires_grad=True)  # softplus of it

    def scores_loss() -> Tensor:
        s = torch.nn.functional.softplus(share)
        return torch.nn.functional.cross_entropy(s[0] * one + s[1] * two, y[known])

    _minimise([share], scores_loss)
    decision.share.copy_(torch.nn.functional.softplus(share).detach())

    _, cues = decision.cues(first, second)
    none = (~known).float()
    # Every kind of non-gesture counts the same, and gestures as much as all of them together.
    counts = torch.bincount(y.clamp(min=0), minlength=int(y.max()) + 1).float()
    kinds = max(int((counts[gestures:] > 0).sum()), 1)
    weight = torch.where(known, 1.0 / known.sum(), 1.0 / counts.clamp(min=1)[y.clamp(min=0)] / kinds)
    slope, bias = torch.zeros(decision.CUES, requires_grad=True), torch.zeros((), requires_grad=True)

    def unknown_loss() -> Tensor:
        raw = (cues * slope).sum(1) + bias
        loss = torch.nn.functional.binary_cross_entropy_with_logits(raw, none, weight, reduction="sum")
        return loss + 1e-3 * (slope**2).sum()

    _minimise([slope, bias], unknown_loss)
    decision.weight.copy_(slope.detach())
    decision.bias.copy_(bias.detach())
    return decision


def _minimise(parameters: list[Tensor], loss: Callable[[], Tensor]) -> None:
    optimiser = torch.optim.LBFGS(parameters, max_iter=200, line_search_fn="strong_wolfe")

    def closure() -> Tensor:
        optimiser.zero_grad()
        value = loss()
        value.backward()  # type: ignore[no-untyped-call]
        return value

    optimiser.step(closure)  # type: ignore[no-untyped-call]


def threshold(
    scores: NDArray[np.float32], unknown: NDArray[np.float32], known: NDArray[np.bool_], lost: float = LOST
) -> float:
    """The confidence that `lost` of the known gestures do not reach."""
    confidence = scores.max(axis=1) * (1 - unknown)
    return float(np.clip(np.quantile(confidence[known], lost), 0.05, 0.95))
