"""Adaptation of a model, judged before and after: people held out in turn, then the decision and the threshold.

Each group of people is judged by networks that have not learned from it, with a decision that was fitted on the others.
Training changes confidences more than the order of the answers, so both models are compared at thresholds at which they
are wrong equally often: as often as the old model at its usual operating point. The threshold is the only number that
is chosen on the answers by which it is judged. The model that is written has learned from all people; its decision and
threshold are fitted on all answers to held-out people.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from gestured.core.points import USUAL
from gestured.lab import decide
from gestured.lab.adapt.learning import Course, Simulated, between, classes_of, learned, opinions
from gestured.lab.adapt.material import Groups, Own, held_out
from gestured.lab.adapt.weights import Base
from gestured.lab.decide import refitted
from gestured.lab.early import Foretold
from gestured.lab.everyday.hours import Least, points_of, thresholds
from gestured.lab.intervals import interval
from gestured.lab.nets import Decision, Judged
from gestured.lab.samples import Samples
from gestured.lab.verifier import Evidence
from gestured.simulator import GESTURES, NONE


@dataclass(frozen=True)
class Answers:
    """Answers to samples, one row each, and rows without an answer for gestures that were never cut out."""

    known: NDArray[np.bool_]  # (N,) a gesture of the model was performed
    named: NDArray[np.int64]  # (N,) the gesture with the best score; 0 if nothing was cut out
    right: NDArray[np.bool_]  # (N,) it is the one that was performed
    confidence: NDArray[np.float64]  # (N,) -1 if nothing was cut out
    unit: NDArray[np.int64]  # (N,) the person, session or stretch, over which intervals are drawn

    @classmethod
    def of(cls, samples: Samples, said: decide.Answers, missed: NDArray[np.int64]) -> "Answers":
        """The answers `said` to samples; `missed` (M,) has the units of gestures that were never cut out."""
        lost = np.zeros(len(missed), np.int64)
        known, named = samples.labels != NONE, said[0].argmax(axis=1)
        return cls(
            np.concatenate([known, lost == 0]),
            np.concatenate([named, lost]),
            np.concatenate([known & (named == classes_of(samples)), lost > 0]),
            np.concatenate([decide.confidence(said), lost - 1]),
            np.concatenate([samples.people, missed]),
        )

    def shares(self, least: Least) -> "Shares":
        """The shares, with answers published from a confidence of `least` on."""
        published = self.confidence >= thresholds(least)[self.named]
        known, others = self.known, ~self.known
        right, wrong = published & self.right, published & known & ~self.right
        low_high = [
            interval(rows[of], self.unit[of])
            for rows, of in ((right, known), (wrong, known), (known & ~published, known), (published, others))
        ]
        return Shares(int(known.sum()), int(others.sum()), *low_high)

    def least_for(self, wrong: float, accepted: float = 1.0) -> float:
        """The lowest confidence from which at most these shares of gestures are `wrong` and of others `accepted`."""
        order = np.argsort(-self.confidence, kind="stable")
        confidence, known = self.confidence[order], self.known[order]
        bad = np.cumsum(known & ~self.right[order]) / max(int(known.sum()), 1)
        taken = np.cumsum(~known) / max(int((~known).sum()), 1)
        over = np.flatnonzero((bad > wrong + 1e-9) | (taken > accepted + 1e-9))
        if not len(over):
            return LOWEST
        return float(np.clip(np.nextafter(confidence[over[0]], 2.0), LOWEST, HIGHEST))


LOWEST, HIGHEST = 0.05, 0.95  # bounds of a threshold

Interval = tuple[float, float, float]  # share, and the ends of its 95 % interval


@dataclass(frozen=True)
class Shares:
    """Shares of the gestures that were performed, and of the non-gestures; NaN if there are none."""

    gestures: int
    others: int
    right: Interval
    wrong: Interval
    unknown: Interval  # of the gestures: unknown, or never cut out
    accepted: Interval  # of the non-gestures

    def as_dict(self) -> dict[str, object]:
        """The shares as JSON values; null for NaN."""
        found: dict[str, object] = {"gestures": self.gestures, "non_gestures": self.others}
        for name in ("right", "wrong", "unknown", "accepted"):
            value = getattr(self, name)
            rounded = [None if np.isnan(one) else round(float(one), 4) for one in value]
            found[name] = {"share": rounded[0], "low": rounded[1], "high": rounded[2]}
        return found


WAYS = (0.25, 0.5, 0.75, 1.0)  # shares of the way from the old weights to the new ones
LOSS = 0.01  # the most of the simulated gestures that may be lost, and of simulated non-gestures accepted in addition


@dataclass(frozen=True)
class Adapted:
    """Adapted networks, their decision and threshold, and the shares of both models."""

    judged: Judged
    least: float  # the confidence from which an answer is published
    before: Shares  # of the old model on own recordings
    after: Shares
    simulated_before: Shares  # of the old model on simulated nominal recordings
    simulated_after: Shares
    way: float  # share of the way from the old weights to the new ones, one of `WAYS`
    groups: Groups
    answers: Answers  # the new model's answers to people who were held out
    provisional: Mapping[str, Any]  # the rule for provisional events
    points: None = None  # the metadata `operating_points`: a model that was adapted to recordings alone has none

    def answered(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(N,) the confidence of each answer to people who were held out, and whether they performed a gesture."""
        cut = self.answers.confidence >= 0
        return self.answers.confidence[cut], self.answers.known[cut]

    def reasons(self) -> list[str]:
        """Why the new model is no better than the old one; empty if it is."""
        found = []
        old, new = self.before, self.after
        if not new.right[0] > old.right[0]:
            found.append(f"right does not go up ({old.right[0]:.3f} -> {new.right[0]:.3f})")
        if new.wrong[0] > old.wrong[0]:
            found.append(f"wrong goes up ({old.wrong[0]:.3f} -> {new.wrong[0]:.3f})")
        lost = self.simulated_before.right[0] - self.simulated_after.right[0]
        if lost > LOSS:
            found.append(f"{100 * lost:.1f} points of the simulated gestures are lost, expected 1 at most")
        taken = self.simulated_after.accepted[0] - self.simulated_before.accepted[0]
        if taken > LOSS:
            remedy = "" if new.others else "; record non-gestures of your own, too (gestured-lab collect)"
            found.append(
                f"{100 * taken:.1f} points more of the simulated non-gestures are accepted, expected 1 at most{remedy}"
            )
        return found


def adapt(base: Base, own: Own, takes: Simulated, course: Course) -> Adapted:
    """Train a model further with own recordings, and judge it before and after."""
    start, least = base.judged, points_of(base.model)[USUAL]
    groups = held_out(own)
    ends = [
        learned(start, takes.teach, own.samples.take(groups.of_samples != k), course, f"without {k + 1}/{groups.count}")
        for k in range(groups.count)
    ]
    run = _Run(start, own, groups.of_samples, takes, ends)
    samples = replace(own.samples, people=groups.unit_of_samples)

    def judged_by(said: decide.Answers) -> Answers:
        return Answers.of(samples, said, groups.unit_of_missed)

    before = judged_by(opinions(start, own.samples).answers(start.decision, start.verifier)).shares(least)
    scores, unknown = np.zeros((len(samples), len(GESTURES)), np.float32), np.zeros(len(samples), np.float32)
    for k in range(groups.count):
        held = groups.of_samples == k
        decision, way = run.decision(ends[k], ~held)
        found = run.said[way].answers(decision, start.verifier)
        scores[held], unknown[held] = (of[held] for of in found)
    new = judged_by((scores, unknown))

    end = learned(start, takes.teach, own.samples, course, "all")
    decision, way = run.decision(end, np.ones(len(own.samples), bool))
    judged = between(start, end, way)
    judged.decision = decision
    chosen = _least(judged_by(run.said[way].answers(decision, start.verifier)), before)
    # The rule for provisional events comes from answers to samples that the networks have not learned from.
    apart = [(between(start, ends[k], way), own.samples.take(groups.of_samples == k)) for k in range(groups.count)]
    parts = [(judged, takes.check), (judged, takes.early), *apart]
    asked = [(nn.ModuleDict({"net": one.net, "trajectory": one.trajectory}), some) for one, some in parts]
    rule = Foretold.sessions(asked).rule("net", judged, chosen)
    shares = before, new.shares(_least(new, before)), _nominal(start, least, takes), _nominal(judged, chosen, takes)
    return Adapted(judged, chosen, *shares, way, groups, new, rule)


class _Run:
    """Answers of networks to the group that each has not seen, at each of `WAYS`, and decisions fitted on them."""

    def __init__(
        self, start: Judged, own: Own, groups: NDArray[np.int64], takes: Simulated, ends: Sequence[Judged]
    ) -> None:
        self._start, self._takes = start, takes
        self._classes = classes_of(own.samples)
        self.said: dict[float, Evidence] = {}
        self._loss: dict[float, NDArray[np.float64]] = {}
        parts = [np.flatnonzero(groups == k) for k in range(len(ends))]
        back = torch.from_numpy(np.argsort(np.concatenate(parts)))
        for way in WAYS:
            found = [
                opinions(between(start, end, way), own.samples.take(part))
                for end, part in zip(ends, parts, strict=True)
            ]
            self.said[way] = Evidence.join(found).take(back)
            self._loss[way] = _losses(start, self.said[way], self._classes)

    def decision(self, end: Judged, others: NDArray[np.bool_]) -> tuple[Decision, float]:
        """A decision for networks on the way to `end`, fitted on held-out answers to `others`, and how far to go."""
        way = min(WAYS, key=lambda one: float(self._loss[one][others].mean()))
        check = self._takes.check
        both = opinions(between(self._start, end, way), check)
        rows = torch.from_numpy(others)
        evidence = Evidence.join([self.said[way].take(rows), both])
        own, made = int(others.sum()), len(check)
        weight = np.concatenate([np.ones(own), np.full(made, own / made)])  # simulated samples weigh as much in all
        classes = np.concatenate([self._classes[others], classes_of(check)])
        return refitted(self._start.decision, evidence.first, evidence.second, classes, weight), way


def _losses(start: Judged, said: Evidence, classes: NDArray[np.int64]) -> NDArray[np.float64]:
    """(G,) negative log likelihood of what was performed, for each sample."""
    scores, unknown = said.answers(start.decision, start.verifier)
    known = classes < len(GESTURES)
    named = scores[np.arange(len(classes)), np.minimum(classes, len(GESTURES) - 1)] * (1 - unknown)
    return -np.log(np.maximum(np.where(known, named, unknown), 1e-6)).astype(np.float64)


def _nominal(judged: Judged, least: Least, takes: Simulated) -> Shares:
    found = opinions(judged, takes.nominal).answers(judged.decision, judged.verifier)
    return Answers.of(takes.nominal, found, takes.missed).shares(least)


def _least(answers: Answers, before: Shares) -> float:
    """The lowest threshold with no more wrong answers, and no more accepted non-gestures, than before."""
    return answers.least_for(before.wrong[0], 1.0 if np.isnan(before.accepted[0]) else before.accepted[0])
