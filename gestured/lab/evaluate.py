"""The figures of models on people from whom they have not learned.

Simulated figures are of the exported .onnx files themselves. Real figures are of networks that were trained without
the subjects they are judged on (three folds).
"""

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from gestured.client.say import say
from gestured.lab.decide import Answers, confidence
from gestured.lab.fit import CLASSES, RECURRENT, targets
from gestured.lab.intervals import interval
from gestured.lab.samples import Samples
from gestured.lab.train import (
    MIXED,
    REAL_SETS,
    Calibrated,
    Trained,
    TrainingData,
    TrainingPlan,
    calibration_set,
    folds,
    is_of,
    judged,
    learn,
)
from gestured.lab.verifier import Evidence
from gestured.model.model import Model
from gestured.simulator import GESTURES, NONE

FEWEST = 20  # samples of a gesture, a person or a kind, below which no share is given
SHARES = ("right", "wrong", "lost", "rejected")  # shares of an evaluation that have intervals


@dataclass(frozen=True, slots=True)
class Evaluation:
    """How good answers are on a set: shares of the gestures that were performed, and of the non-gestures."""

    gestures: int
    others: int
    right_before: float  # without rejection; what was not cut out counts as not right
    right: float
    wrong: float
    lost: float  # to unknown, or never cut out
    rejected: float  # of the non-gestures
    people: int  # number of people who performed
    intervals: dict[str, dict[str, float]]  # low and high, 95 % over people, by name


def outcome(
    answers: Answers, labels: NDArray[np.int64], least: float, performed: int, people: NDArray[np.int64]
) -> Evaluation:
    """Judge answers against classes (N,) of `people` (N,), published from a confidence of `least` on.

    `performed`: how many gestures were performed, whether or not they were cut out. It is not known whose gestures were
    never cut out, so their share is taken as fixed in the intervals.
    """
    scores, _ = answers
    known = (labels >= 0) & (labels < scores.shape[1])
    total = max(performed, int(known.sum()))
    published = confidence(answers) >= least
    right = scores.argmax(axis=1) == labels

    def share(chosen: NDArray[np.bool_], of: int) -> float:
        return float(chosen.sum() / of) if of else float("nan")

    def ends(chosen: NDArray[np.bool_], of: NDArray[np.bool_]) -> NDArray[np.float64]:
        return np.array(interval(chosen[of], people[of])[1:])

    hits, misses = share(right & published & known, total), share(~right & published & known, total)
    cut = known.sum() / max(total, 1)  # the share of the gestures that were cut out
    found = (
        cut * ends(right & published, known), cut * ends(~right & published, known),
        cut * ends(~published, known) + 1 - cut, ends(~published, ~known),
    )  # fmt: skip
    lows_highs = {
        name: {"low": float(low), "high": float(high)} for name, (low, high) in zip(SHARES, found, strict=True)
    }
    return Evaluation(
        total, int((~known).sum()), share(right & known, total), hits, misses, 1 - hits - misses,
        share(~published & ~known, int((~known).sum())), len(np.unique(people)), lows_highs,
    )  # fmt: skip


def model_answers(model: Model, samples: Samples) -> Answers:
    """Scores (N, G) and unknown (N,) of a model for all samples, in their order."""
    if model.metadata.features is not None:
        return model.run(samples.features())
    scores = np.zeros((len(samples), len(model.gestures)), np.float32)
    unknown = np.zeros(len(samples), np.float32)
    for index, windows in samples.alike(200):
        scores[index], unknown[index] = model.run(windows, beside=samples.context[index])
    return scores, unknown


def simulated_figures(models: Mapping[str, Model], data: TrainingData) -> dict[str, dict[str, Any]]:
    """The figures of each model on each test set, with the share of each kind that was answered rightly."""
    found: dict[str, dict[str, Any]] = {}
    for name, model in models.items():
        found[name] = {}
        for test, samples in data.tests.items():
            given = model_answers(model, samples)
            result = outcome(given, targets(samples), model.threshold, data.performed[test], samples.people)
            more = {"kinds": by_kind(given, samples, model.threshold), "worst": worst(given, samples, model.threshold)}
            found[name][test] = asdict(result) | more
    return found


def by_kind(given: Answers, samples: Samples, least: float) -> dict[str, float]:
    """By kind, the share of a gesture's samples named rightly, or of a non-gesture's rejected."""
    good = _good(given, samples, least)
    return {str(kind): round(float(good[samples.kinds == kind].mean()), 3) for kind in np.unique(samples.kinds)}


def _good(given: Answers, samples: Samples, least: float) -> NDArray[np.bool_]:
    """(N,) whether a gesture was named rightly, or a non-gesture rejected."""
    published = confidence(given) >= least
    return np.where(samples.labels == NONE, ~published, published & (given[0].argmax(axis=1) == targets(samples)))


def worst(given: Answers, samples: Samples, least: float) -> dict[str, tuple[str, float, int]]:
    """The gesture and the person that were named rightly least often, and the kind of non-gesture rejected least often.

    Each has its share and its number of samples; those with fewer than `FEWEST` samples are left out.
    """
    good, classes = _good(given, samples, least), targets(samples)
    meant, names = (classes >= 0) & (classes < len(GESTURES)), np.array(CLASSES)[classes]
    people = np.char.add("no. ", samples.people.astype(str))
    groups = {"gesture": (names, meant), "person": (people, meant), "non-gesture": (names, classes >= len(GESTURES))}
    found: dict[str, tuple[str, float, int]] = {}
    for title, (of, chosen) in groups.items():
        counted = zip(*np.unique(of[chosen], return_counts=True), strict=True)
        rows = [(float(good[chosen & (of == name)].mean()), str(name), int(n)) for name, n in counted if n >= FEWEST]
        for share, name, count in sorted(rows)[:1]:
            found[title] = name, round(share, 3), count
    return found


def without(calibrated: Calibrated, real: Samples, held: NDArray[np.bool_]) -> Calibrated:
    """The calibration set without some of the real samples; those that have a class stand at its end."""
    left = ~held[targets(real) >= 0]
    keep = np.concatenate([np.ones(len(calibrated.labels) - len(left), bool), left])
    found = {name: x[torch.from_numpy(keep)] for name, x in calibrated.logits.items()}
    return Calibrated(found, calibrated.labels[keep], calibrated.sets[keep])


def real_figures(plan: TrainingPlan, data: TrainingData, cache: Path) -> dict[str, Any]:
    """The figures on real subjects, by networks that were trained and calibrated without them.

    The first network is also judged before it learned from any real recording, which shows what real recordings add.
    Networks that are not in the cache are trained. Without real recordings there are no figures.
    """
    real = data.real
    if real is None:
        words = "left out, since no --real FOLDER was named; their figures of the same models stay"
        say(f"real recordings: {words}", to=sys.stderr)
        return {}
    trained, labels = learn(plan, data, cache), targets(real)
    calibrated = calibration_set(trained, data)
    found: dict[str, Any] = {}
    for name in RECURRENT:
        scores = np.zeros((len(real), len(GESTURES)), np.float32)
        unknown = np.zeros(len(real), np.float32)
        levels = []
        for nets, held in zip(trained.folds, folds(real), strict=True):
            module, calibration, _ = judged(trained, name, without(calibrated, real, held), data)
            evidence = Evidence.of(nets, name, real.take(held))
            scores[held], unknown[held] = evidence.answers(module.decision, module.verifier)
            levels.append(calibration["threshold"])
        least = float(np.mean(levels))
        judged_once = np.arange(len(real)) < data.real_judged
        for title in REAL_SETS:
            chosen = is_of(real.labels, title) & judged_once
            answers = scores[chosen], unknown[chosen]
            result = outcome(answers, labels[chosen], least, data.performed[title], real.people[chosen])
            found.setdefault(name, {})[title] = asdict(result) | {"worst": worst(answers, real.take(chosen), least)}
        found[name]["kinds"] = by_kind((scores, unknown), real, least)
        if name == RECURRENT[0]:
            title = f"{MIXED}, learned from simulation alone"
            found[name][title] = _by_simulation(trained, name, data, real.take(np.flatnonzero(judged_once)))
    return found


def _by_simulation(trained: Trained, name: str, data: TrainingData, real: Samples) -> dict[str, Any]:
    """The figures on real subjects of a network before it learned from any real recording, calibrated without any."""
    assert trained.start is not None
    alone = Trained(trained.start, None)
    module, calibration, _ = judged(alone, name, calibration_set(alone, data), data)
    given = alone.evidence(name, real).answers(module.decision, module.verifier)
    return asdict(outcome(given, targets(real), calibration["threshold"], data.performed[MIXED], real.people))
