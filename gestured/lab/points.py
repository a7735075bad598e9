"""The operating points of a model: thresholds by strictness, and the curve of missed gestures against false ones.

They are chosen on hours of simulated everyday life of people of whom no network knows. What one false gesture costs in
lost ones is the same for all gestures of a point; it is the number at which the point keeps its budget.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.points import STRICTNESS
from gestured.lab.decide import Answers, confidence
from gestured.lab.fit import targets
from gestured.lab.samples import EVERYDAY, Samples
from gestured.simulator import GESTURES, NONE

# Of each gesture's right answers, the most that a point may lose: a budget alone would be kept by giving up the taps,
# which are what everyday life most looks like.
LOST = dict(zip(STRICTNESS, (0.05, 0.15, 0.4), strict=True))
BUDGETS = dict(zip(STRICTNESS, (4.0, 0.7, 0.15), strict=True))  # false gestures an hour, on simulated everyday life
COSTS = np.geomspace(0.001, 100.0, 400)  # gestures lost that one false gesture counts as much as
LEVELS = np.round(np.concatenate([np.arange(0.05, 0.95, 0.01), np.arange(0.95, 0.9995, 0.001)]), 4)
WRONG = 2.0  # lost gestures that a gesture taken for another one counts as much as


def operating_points(answers: Answers, lived: Samples, performed: int, hours: float) -> dict[str, Any]:
    """The metadata `operating_points` by answers to (G,) segments of so many hours in which gestures were performed.

    A gesture that was performed and never cut out is missed at every point.
    """
    best, sure = answers[0].argmax(axis=1), confidence(answers)
    label = targets(lived)
    known, false = lived.labels != NONE, lived.kinds == EVERYDAY
    right = known & (best == label)
    # (G, L) by gesture and level: how many were right, wrong and false there
    rightly, wrongly, falsely = (_by_level(best, sure, chosen) for chosen in (right, known & ~right, false))
    found: dict[str, Any] = {}
    for name in STRICTNESS:
        level = _levels(rightly, wrongly, falsely, BUDGETS[name] * hours, LOST[name])
        of = np.arange(len(GESTURES)), level
        found[name] = {
            "thresholds": {gesture: float(LEVELS[k]) for gesture, k in zip(GESTURES, level, strict=True)},
            "provisional": None,
            "missed": round(1.0 - float(rightly[of].sum()) / performed, 4),
            "false_per_hour": round(float(falsely[of].sum()) / hours, 3),
            "hours": round(hours, 1),
        }
    rights, falses = rightly.sum(axis=0), falsely.sum(axis=0)
    rows = [(LEVELS[k], 1.0 - rights[k] / performed, falses[k] / hours) for k in range(len(LEVELS))]
    found["curve"] = [[round(float(value), 4) for value in row] for row in rows]
    return found


def _by_level(best: NDArray[np.int64], sure: NDArray[np.floating], chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(G, L) how many of the chosen segments are named each gesture with at least each of LEVELS."""
    counts = [(sure[chosen & (best == g)][:, None] >= LEVELS).sum(axis=0) for g in range(len(GESTURES))]
    return np.array(counts, np.int64)


def _levels(
    right: NDArray[np.int64], wrong: NDArray[np.int64], false: NDArray[np.int64], budget: float, lost: float
) -> NDArray[np.int64]:
    """(G,) the level of each gesture at the least cost of a false one that keeps them within the budget.

    Where a gesture would lose more than that share of its right answers, it stays where it loses so many.
    """
    bearable = right >= (1.0 - lost) * right[:, :1]
    for cost in COSTS:
        worth = np.where(bearable, right - WRONG * wrong - cost * false, -np.inf)
        level = np.asarray(worth.argmax(axis=1))
        if false[np.arange(len(level)), level].sum() <= budget:
            break
    return level


def by_strictness(points: Mapping[str, Any]) -> str:
    """What the points cost, a line each."""
    return "\n".join(
        f"{name}: {points[name]['false_per_hour']:.2f} false an hour, {points[name]['missed']:.3f} missed"
        for name in STRICTNESS
    )
