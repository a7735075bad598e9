"""Calibration: how two opinions become probabilities, and from which confidence on a gesture is published.

All of it is fitted on people that the networks have not learned from.
"""

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gestured.lab.nets import Decision

THRESHOLDS = tuple(round(0.05 + 0.01 * k, 2) for k in range(91))
WRONG = 2.0  # points of lost gestures that weigh as much as a point of gestures taken for another one
BELIEF = 100.0  # loss, in samples, of a number of the old decision that moves by one
ACCEPTED = 0.25  # points of lost gestures that weigh as much as a point of non-gestures taken for a gesture

Answers = tuple[NDArray[np.float32], NDArray[np.float32]]  # scores (N, G), unknown (N,)


def fit_decision(first: Tensor, second: Tensor, labels: NDArray[np.int64], gestures: int) -> Decision:
    """Fit shares (temperatures) and rejection on logits (N, K) of both opinions, classes (N,); >= gestures is none."""
    decision = Decision(gestures)
    y = torch.from_numpy(labels)
    known = (y >= 0) & (y < gestures)
    one, two = first.log_softmax(1)[known, :gestures], second.log_softmax(1)[known, :gestures]
    share = torch.tensor([0.0, 0.0], requires_grad=True)  # their softplus is `decision.share`

    def scores_loss() -> Tensor:
        s = torch.nn.functional.softplus(share)
        return torch.nn.functional.cross_entropy(s[0] * one + s[1] * two, y[known])

    minimise([share], scores_loss)
    decision.share.copy_(torch.nn.functional.softplus(share).detach())

    _, cues = decision.cues(first, second)
    none = (~known).float()
    # Every kind of non-gesture weighs the same, and gestures weigh as much as all kinds together.
    counts = torch.bincount(y.clamp(min=0), minlength=int(y.max()) + 1).float()
    kinds = max(int((counts[gestures:] > 0).sum()), 1)
    weight = torch.where(known, 1.0 / known.sum(), 1.0 / counts.clamp(min=1)[y.clamp(min=0)] / kinds)
    slope, bias = torch.zeros(decision.CUES, requires_grad=True), torch.zeros((), requires_grad=True)

    def unknown_loss() -> Tensor:
        raw = (cues * slope).sum(1) + bias
        loss = torch.nn.functional.binary_cross_entropy_with_logits(raw, none, weight, reduction="sum")
        return loss + 1e-3 * (slope**2).sum()

    minimise([slope, bias], unknown_loss)
    decision.weight.copy_(slope.detach())
    decision.bias.copy_(bias.detach())
    return decision


def refitted(
    start: Decision, first: Tensor, second: Tensor, classes: NDArray[np.int64], weight: NDArray[np.float64]
) -> Decision:
    """A decision fitted again, from an old one that is kept until enough samples say otherwise.

    Takes logits (N, K) of both opinions, classes (N,) and the weight of each sample (N,). Non-gestures weigh as much as
    gestures, however many there are, since a choice of recordings does not show how often people do something else.
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
    shares = torch.log(torch.expm1(start.share.clamp(min=1e-3)))  # the inverse of softplus
    old = [shares, start.weight, start.bias]
    raw, slope, bias = (value.detach().clone().requires_grad_() for value in old)

    def loss() -> Tensor:
        share = torch.nn.functional.softplus(raw)
        named = torch.nn.functional.cross_entropy(share[0] * one + share[1] * two, y[known], reduction="none")
        decision.share = share  # the cues depend on it
        _, cues = decision.cues(first, second)
        none = torch.nn.functional.binary_cross_entropy_with_logits(
            (cues * slope).sum(1) + bias, (~known).to(first.dtype), counts, reduction="sum"
        )
        moved = sum(((new - before) ** 2).sum() for new, before in zip((raw, slope, bias), old, strict=True))
        return (named * counts[known]).sum() + none + BELIEF * moved

    minimise([raw, slope, bias], loss)
    decision.share = torch.nn.functional.softplus(raw).detach()
    decision.weight = slope.detach()
    decision.bias = bias.detach()
    return decision


def minimise(parameters: list[Tensor], loss: Callable[[], Tensor]) -> None:
    """Minimise the loss over the parameters (L-BFGS)."""
    optimiser = torch.optim.LBFGS(parameters, max_iter=200, line_search_fn="strong_wolfe")

    def closure() -> Tensor:
        optimiser.zero_grad()
        value = loss()
        value.backward()  # type: ignore[no-untyped-call]
        return value

    optimiser.step(closure)  # type: ignore[no-untyped-call]


def decided(decision: Decision, first: Tensor, second: Tensor) -> Answers:
    """The answers of a decision to both opinions' logits (N, K)."""
    with torch.no_grad():
        scores, unknown = decision(first, second)
    return scores.numpy(), unknown.numpy()


def confidence(answers: Answers) -> NDArray[np.float32]:
    """(N,) the confidence of each answer in its best gesture."""
    scores, unknown = answers
    return np.asarray(scores.max(axis=1) * (1 - unknown))


def calibration_of(decision: Decision, least: float) -> dict[str, Any]:
    """The metadata `calibration` of networks with this decision that publish from a confidence of `least` on."""
    return {
        "temperature": (1 / decision.share.clamp(min=1e-6)).tolist(),  # of the network and of the trajectory net
        "unknown_weight": decision.weight.tolist(),
        "unknown_bias": float(decision.bias),
        "threshold": least,
    }


def curve(answers: Answers, labels: NDArray[np.int64]) -> NDArray[np.float64]:
    """(len(THRESHOLDS), 3) right, wrong and accepted at each threshold, for classes (N,); from G on they are none.

    Right and wrong are shares of the gestures, accepted is one of the non-gestures; NaN if there are none.
    """
    scores, _ = answers
    known, right = labels < scores.shape[1], scores.argmax(axis=1) == labels
    published = confidence(answers)[None, :] >= np.array(THRESHOLDS)[:, None]
    with np.errstate(invalid="ignore"):
        gestures, others = np.float64(known.sum()), np.float64((~known).sum())
        rightly, wrongly = ((published & known & so).sum(1) / gestures for so in (right, ~right))
        return np.stack([rightly, wrongly, (published & ~known).sum(1) / others], 1)


def threshold(answers: Answers, labels: NDArray[np.int64], sets: NDArray[np.int64] | None = None) -> float:
    """The confidence from which answers are published: the best balance of right, wrong and accepted ones.

    `sets` (N,) has the set of each answer (simulated, real ...); every set weighs the same, however large.
    """
    of = np.zeros(len(labels), np.int64) if sets is None else sets
    scores, unknown = answers
    worth = []
    for k in np.unique(of):
        right, wrong, accepted = np.nan_to_num(curve((scores[of == k], unknown[of == k]), labels[of == k])).T
        worth.append(right - WRONG * wrong - ACCEPTED * accepted)
    return THRESHOLDS[int(np.mean(worth, axis=0).argmax())]
