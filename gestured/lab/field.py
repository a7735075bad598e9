"""Deciding early, beside the field: our rule, a threshold on the probability, and CALIMERA, on the same prefixes.

CALIMERA (Bilski and Jastrzebska, Information Processing & Management 2023) is written anew from the paper: from the
last frame backward a kernel ridge regression learns how much less stopping now costs than the best that follows.
All stop once and for ever; ours may be revoked, which this comparison does not count for it. No rejection here.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.kernel_ridge import KernelRidge

from gestured.lab.early import Asked, by_contact, events

LONGEST = 60  # frames; 4 s
MOST = 1500  # contacts that a regression learns from
WRONG_COSTS = (0.9, 0.97, 0.99)  # share of a wrong answer in the cost; the rest is a second of waiting
THRESHOLDS = (0.8, 0.9, 0.95)


@dataclass(frozen=True, slots=True)
class Contacts:
    """Questions about gestures that are no taps, and what would be answered in the end."""

    asked: Asked  # answer: the best gesture of the whole, never -1
    scores: NDArray[np.float32]  # (N, G) of each question
    truth: NDArray[np.int64]  # (G,) gesture

    def step(self) -> NDArray[np.int64]:
        """(N,) the how manieth question about its contact each is, from 0."""
        contact = self.asked.contact
        return np.arange(len(contact)) - np.searchsorted(contact, contact)

    def judged(self, stops: NDArray[np.int64]) -> dict[str, float]:
        """Earliness, accuracy and their harmonic mean, stopping at these questions (G,), -1 for the end."""
        counts = np.bincount(self.asked.contact, minlength=len(self.truth))
        early = stops >= 0
        said = np.where(early, self.asked.best[stops], self.asked.answer)
        share = np.where(early, (self.step()[stops] + 1) / np.maximum(counts, 1), 1.0)
        right, earliness = float((said == self.truth).mean()), float(share.mean())
        return {
            "earliness": round(earliness, 3),
            "accuracy": round(right, 3),
            "harmonic_mean": round(2 * right * (1 - earliness) / max(right + 1 - earliness, 1e-9), 3),
        }


def probability_threshold(contacts: Contacts, least: float) -> NDArray[np.int64]:
    """(G,) the first question whose best score reaches `least`, -1 for none."""
    return by_contact(contacts.scores.max(axis=1) >= least, contacts.asked)


def calimera(teach: Contacts, test: Contacts, wrong_cost: float) -> NDArray[np.int64]:
    """(G,) the question at which CALIMERA stops, -1 for the end; it learns from `teach`."""
    step, of, count = teach.step(), teach.asked.contact, len(teach.truth)
    seconds = teach.asked.elapsed_s
    lasted = np.zeros(count)
    np.maximum.at(lasted, of, seconds)
    future = wrong_cost * (teach.asked.answer != teach.truth) + (1 - wrong_cost) * (lasted + 1 / 15)
    regressions: dict[int, Any] = {}
    rng = np.random.default_rng(0)
    for k in range(min(int(step.max()), LONGEST), -1, -1):
        now = np.flatnonzero(step == k)
        if len(now) < 30:
            continue
        cost = wrong_cost * (teach.asked.best[now] != teach.truth[of[now]]) + (1 - wrong_cost) * seconds[now]
        gain = future[of[now]] - cost  # what stopping now saves
        some = rng.permutation(len(now))[:MOST]
        regressions[k] = KernelRidge(alpha=1.0, kernel="rbf").fit(teach.scores[now[some]], gain[some])
        stop = regressions[k].predict(teach.scores[now]) > 0
        future[of[now[stop]]] = cost[stop]
    found = np.full(len(test.truth), -1, np.int64)
    steps = test.step()
    for k, regression in sorted(regressions.items()):
        now = np.flatnonzero((steps == k) & (found[test.asked.contact] < 0))
        if len(now):
            stop = now[regression.predict(test.scores[now]) > 0]
            found[test.asked.contact[stop]] = stop
    return found


def table(teach: Contacts, test: Contacts, rule: Mapping[str, Any], gestures: tuple[str, ...]) -> dict[str, Any]:
    """Every rule's figures, by its name."""
    rows = {"at the end": np.full(len(test.truth), -1, np.int64)}
    rows["ours"] = events(test.asked, dict(rule), gestures)
    rows |= {f"probability threshold {p}": probability_threshold(test, p) for p in THRESHOLDS}
    rows |= {f"CALIMERA, wrong costs {c}": calimera(teach, test, c) for c in WRONG_COSTS}
    return {name: test.judged(stops) for name, stops in rows.items()}
