"""A decision fitted again, but not from nothing: the old one is believed until enough people say otherwise."""

import copy

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from gestured.lab.decide import minimise
from gestured.lab.nets import Decision

BELIEF = 100.0  # samples' worth of loss for each number of the old decision that moves by one


def refitted(
    start: Decision, first: Tensor, second: Tensor, classes: NDArray[np.int64], weight: NDArray[np.float64]
) -> Decision:
    """Shares and rejection for logits (N, K) of both opinions, classes (N,) and how much each sample counts (N,).

    Non-gestures count as much as gestures, however many there are: how often people do something else is not to be
    learned from what somebody chose to record.
    """
    decision = copy.deepcopy(start)
    gestures = decision.gestures
    y = torch.from_numpy(classes)
    known = y < gestures
    counts = torch.tensor(weight, dtype=first.dtype)
    if known.all() or not known.any():
        return decision
    counts = torch.where(known, counts, counts * counts[known].sum() / counts[~known].sum())
    one, two = first.log_softmax(1)[known, :gestures], second.log_softmax(1)[known, :gestures]
    shares = torch.log(torch.expm1(start.share.clamp(min=1e-3)))  # softplus of it
    old = [shares, start.weight, start.bias]
    raw, slope, bias = (value.detach().clone().requires_grad_() for value in old)

    def loss() -> Tensor:
        share = functional.softplus(raw)
        named = functional.cross_entropy(share[0] * one + share[1] * two, y[known], reduction="none")
        decision.share = share  # the cues of a non-gesture depend on it
        _, cues = decision.cues(first, second)
        none = functional.binary_cross_entropy_with_logits(
            (cues * slope).sum(1) + bias, (~known).to(first.dtype), counts, reduction="sum"
        )
        moved = sum(((new - before) ** 2).sum() for new, before in zip((raw, slope, bias), old, strict=True))
        return (named * counts[known]).sum() + none + BELIEF * moved

    minimise([raw, slope, bias], loss)
    decision.share = functional.softplus(raw).detach()
    decision.weight = slope.detach()
    decision.bias = bias.detach()
    return decision
