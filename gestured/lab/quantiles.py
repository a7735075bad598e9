"""Quantiles of training data and of a model's answers to new people, with which a deployment is compared."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.lab.samples import WINDOW, Samples
from gestured.model.features import MEASURES, measures
from gestured.simulator import NONE

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)


def quantiles(samples: Samples) -> dict[str, Any]:
    """Quantiles of the training gestures' measures, to compare a deployment with."""
    known = samples.take(samples.labels != NONE)
    found = [measures(known.window(i), WINDOW.rate_hz) for i in range(len(known))]
    values = {"strength": known.strength} | {name: np.array([one[name] for one in found]) for name in MEASURES}
    return {"at": list(QUANTILES)} | {name: _at(value) for name, value in values.items()}


def _at(values: NDArray[np.floating]) -> list[float]:
    """The values at `QUANTILES`, each rounded to five digits."""
    return [float(f"{value:.5g}") for value in np.quantile(values, QUANTILES)]


def answer_figures(confidence: NDArray[np.floating], known: NDArray[np.bool_], least: float) -> dict[str, Any]:
    """A model's answers to gestures of people whom it has not seen: quantiles of confidence, and the share unknown."""
    given = confidence[known]
    answered = given[given >= least] if (given >= least).any() else given
    return {"confidence": _at(answered), "unknown": round(float((given < least).mean()), 4)}
