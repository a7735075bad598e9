"""The forest at the ladder's end: grown on touch-pattern features, and calibrated."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestClassifier

from gestured.lab.decide import confidence
from gestured.lab.fit import CLASSES, targets
from gestured.lab.forest_graph import forest_outputs
from gestured.lab.quantiles import answer_figures
from gestured.lab.samples import Samples, join
from gestured.simulator import GESTURES


def grow_forest(
    teach: Samples, real: Samples | None, calibrate: Samples, seed: int, jobs: int
) -> tuple[RandomForestClassifier, dict[str, Any], dict[str, Any]]:
    """The touch-pattern forest of the paper's Table IV (depth 9), with a class for what is no gesture.

    100 trees, half the paper's: the file is half as large, and answers people of whom it knows nothing as well.

    Gives what `train.judged` gives: the forest, its calibration, and how it answers people that it has not seen.
    """
    samples = teach if real is None else join([teach, real])
    classes = np.minimum(_classes(samples), len(GESTURES))
    # Each class counts as much as any other, and the real recordings, which know taps and swipes alone, for a fifth.
    weights = np.where(np.arange(len(samples)) < len(teach), 1.0, 0.2)
    weights /= np.bincount(classes, weights)[classes]
    forest = RandomForestClassifier(100, max_depth=9, min_samples_leaf=2, n_jobs=jobs, random_state=seed)
    forest.fit(samples.features(), classes, sample_weight=weights)
    labels = np.minimum(_classes(calibrate), len(GESTURES))
    chances = forest.predict_proba(calibrate.features())
    calibration = _forest_calibration(chances, labels)
    sure = confidence(forest_outputs(chances, len(GESTURES), calibration))
    return forest, calibration, answer_figures(sure, labels < len(GESTURES), calibration["threshold"])


def _classes(samples: Samples) -> NDArray[np.int64]:
    labels = targets(samples)
    return np.where(labels < 0, len(CLASSES), labels)


def _forest_calibration(chances: NDArray[np.float64], labels: NDArray[np.int64]) -> dict[str, Any]:
    """Temperature by likelihood; a threshold from which at most 6 % of the calibration gestures are wrong."""
    known = labels < len(GESTURES)
    best: tuple[float, dict[str, Any]] | None = None
    for temperature in np.geomspace(0.2, 2.0, 24):
        calibration = {"temperature": float(temperature)}
        scores, _ = forest_outputs(chances, len(GESTURES), calibration)
        loss = -float(np.log(np.maximum(scores[known, labels[known]], 1e-9)).mean())
        if best is None or loss < best[0]:
            best = loss, calibration
    assert best is not None
    calibration = best[1]
    answers = forest_outputs(chances, len(GESTURES), calibration)
    sure, wrong = confidence(answers), known & (answers[0].argmax(axis=1) != labels)
    for least in np.linspace(0.05, 0.95, 91):
        calibration["threshold"] = round(float(least), 3)
        if (wrong & (sure >= least)).sum() <= 0.06 * known.sum() and (sure[~known] >= least).mean() <= 0.1:
            break
    return calibration
