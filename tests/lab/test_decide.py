"""Calibration: probabilities that mean what they say, and a threshold that costs what was agreed."""

import numpy as np
import pytest
import torch
from torch import Tensor

from gestured.lab.decide import ACCEPTED, THRESHOLDS, WRONG, curve, fit_decision, threshold
from gestured.lab.nets import Decision

GESTURES, KINDS = 5, 4  # of gestures, and of non-gestures


def honest(count: int, seed: int = 0, kinds: int = KINDS) -> tuple[Tensor, np.ndarray]:
    """Logits (N, K) and classes (N,) drawn from their own softmax: calibrated by construction."""
    generator = torch.Generator().manual_seed(seed)
    logits = 2.0 * torch.randn(count, GESTURES + kinds, generator=generator)
    labels = torch.multinomial(logits.softmax(1), 1, generator=generator)[:, 0]
    return logits, labels.numpy()


def calibration_error(scores: Tensor, labels: np.ndarray, bins: int = 10) -> float:
    """Expected calibration error (Guo et al. 2017) of the best score, over the gestures."""
    known = labels < GESTURES
    most, best = scores.max(1)
    sure, right = most.numpy()[known], best.numpy()[known] == labels[known]
    place = np.minimum((sure * bins).astype(int), bins - 1)
    return sum(abs(sure[place == b].sum() - right[place == b].sum()) for b in range(bins)) / known.sum()


def said(decision: Decision, first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
    with torch.no_grad():
        found: tuple[Tensor, Tensor] = decision(first, second)
    return found


@pytest.mark.parametrize("factor", [0.5, 2.0, 4.0])
def test_an_overconfident_opinion_is_brought_back(factor: float) -> None:
    logits, labels = honest(6000)
    blind = torch.zeros_like(logits)  # the second one has no opinion
    fitted = fit_decision(factor * logits, blind, labels, GESTURES)
    unseen, truth = honest(6000, seed=1)
    raw = Decision(GESTURES)
    raw.share.copy_(torch.tensor([1.0, 0.0]))
    blind = torch.zeros_like(unseen)
    before = calibration_error(said(raw, factor * unseen, blind)[0], truth)
    after = calibration_error(said(fitted, factor * unseen, blind)[0], truth)
    assert after < before / 2
    assert after < 0.03
    assert float(fitted.share[0]) == pytest.approx(1 / factor, rel=0.1)


def test_the_better_opinion_weighs_more() -> None:
    logits, labels = honest(4000)
    noise = 3 * torch.randn(logits.shape, generator=torch.Generator().manual_seed(8))
    fitted = fit_decision(logits + noise, logits, labels, GESTURES)
    assert float(fitted.share[1]) > 3 * float(fitted.share[0])
    swapped = fit_decision(logits, logits + noise, labels, GESTURES)
    assert float(swapped.share[0]) == pytest.approx(float(fitted.share[1]), rel=0.05)


def two_opinions(count: int, seed: int) -> tuple[Tensor, Tensor, np.ndarray]:
    """Two nets that see the same thing with errors of their own."""
    logits, labels = honest(count, seed)
    generator = torch.Generator().manual_seed(seed + 100)
    one, two = (logits + torch.randn(logits.shape, generator=generator) for _ in range(2))
    return one, two, labels


def test_unknown_is_a_probability_that_tells_gestures_from_the_rest() -> None:
    one, two, labels = two_opinions(4000, 0)
    fitted = fit_decision(one, two, labels, GESTURES)
    one, two, labels = two_opinions(4000, 1)
    unknown = said(fitted, one, two)[1].numpy()
    none = labels >= GESTURES
    order = np.argsort(np.argsort(unknown))
    auroc = (order[none].mean() - (none.sum() - 1) / 2) / (~none).sum()
    assert auroc > 0.8
    assert unknown[none].mean() > unknown[~none].mean() + 0.2


def test_more_evidence_for_none_never_makes_it_less_unknown() -> None:
    """Both opinions lean towards the non-gestures, and nothing else changes."""
    one, two, labels = two_opinions(3000, 2)
    fitted = fit_decision(one, two, labels, GESTURES)
    lean = torch.cat([torch.zeros(GESTURES), torch.ones(KINDS)])
    last = said(fitted, one, two)[1]
    for step in (0.5, 1.0, 2.0, 4.0):
        unknown = said(fitted, one + step * lean, two + step * lean)[1]
        assert bool((unknown >= last - 1e-6).all()), step
        last = unknown


def test_two_opinions_that_disagree_are_less_sure_than_two_that_agree() -> None:
    one, two, labels = two_opinions(4000, 4)
    fitted = fit_decision(one, two, labels, GESTURES)
    sure = torch.full((1, GESTURES + KINDS), -3.0)
    left, right = sure.clone(), sure.clone()
    left[0, 0] = right[0, 1] = 3.0
    (agree, calm), (differ, wary) = said(fitted, left, left), said(fitted, left, right)
    assert float(differ.max() * (1 - wary)) < float(agree.max() * (1 - calm))


def test_a_kind_that_is_recorded_often_counts_no_more_than_another() -> None:
    one, two, labels = two_opinions(2500, 5)
    often = np.concatenate([np.arange(len(labels)), *[np.flatnonzero(labels == GESTURES)] * 9])
    plain = fit_decision(one, two, labels, GESTURES)
    heavy = fit_decision(one[often], two[often], labels[often], GESTURES)
    a, b = said(plain, one, two)[1], said(heavy, one, two)[1]
    assert float((a - b).abs().max()) < 0.02


@pytest.mark.parametrize("kinds", [0, 1])
def test_calibration_without_many_non_gestures_is_finite(kinds: int) -> None:
    logits, labels = honest(800, seed=6, kinds=1)
    if not kinds:
        keep = labels < GESTURES
        logits, labels = logits[torch.from_numpy(keep)], labels[keep]
    fitted = fit_decision(logits, logits, labels, GESTURES)
    scores, unknown = said(fitted, logits, logits)
    assert bool(torch.isfinite(scores).all())
    assert bool(torch.isfinite(unknown).all())


def answers(count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scores, unknown and classes of 4 gestures and none; what has a confidence c is right with probability c."""
    rng = np.random.default_rng(seed)
    confidence = rng.random(count).astype(np.float32)
    best = rng.integers(0, 4, count)
    labels = np.where(rng.random(count) < confidence, best, (best + 1) % 4)
    labels[rng.random(count) < 0.3] = 4
    scores = np.full((count, 4), 0.1 / 3, np.float32)
    scores[np.arange(count), best] = 0.9
    return scores, 1 - confidence / np.float32(0.9), labels


def worth(scores: np.ndarray, unknown: np.ndarray, labels: np.ndarray, least: float) -> float:
    said, known = scores.max(axis=1) * (1 - unknown) >= least, labels < 4
    right = scores.argmax(axis=1) == labels
    return float((said & right)[known].mean() - WRONG * (said & ~right)[known].mean() - ACCEPTED * said[~known].mean())


@pytest.mark.parametrize("seed", range(4))
def test_no_other_threshold_is_worth_more(seed: int) -> None:
    made = answers(3000, seed)
    best = threshold(made[:2], made[2])
    assert worth(*made, best) >= max(worth(*made, least) for least in np.linspace(0.05, 0.95, 91)) - 1e-3


def test_every_set_counts_the_same_however_large() -> None:
    small, large = answers(300, 1), answers(30_000, 2)
    scores, unknown, labels = (np.concatenate([a, b]) for a, b in zip(small, large, strict=True))
    unknown[:300] = unknown[:300] * 0.1
    sets = np.repeat([0, 1], [300, 30_000])
    again = np.concatenate([np.tile(np.arange(300), 50), np.arange(300, 30_300)])
    one = threshold((scores, unknown), labels, sets)
    assert one == threshold((scores[again], unknown[again]), labels[again], sets[again])


def test_the_curve_counts_what_a_user_sees() -> None:
    scores = np.float32([[0.9, 0.1], [0.9, 0.1], [0.2, 0.8], [0.6, 0.4]])
    points = curve((scores, np.zeros(4, np.float32)), np.array([0, 1, 1, 2]))
    at = dict(zip(THRESHOLDS, points.tolist(), strict=True))
    assert at[0.5] == pytest.approx([2 / 3, 1 / 3, 1])
    assert at[0.7] == pytest.approx([2 / 3, 1 / 3, 0])
    assert at[0.85] == pytest.approx([1 / 3, 1 / 3, 0])
