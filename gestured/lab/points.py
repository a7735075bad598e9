"""The operating points of a model: thresholds by strictness, and the curve of missed gestures against false ones.

They are chosen on hours of simulated everyday life of people from whom no network has learned. Gestures that are turned
or mirrored images of one another share a threshold: the best balance of right, wrong and false answers.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.points import STRICTNESS
from gestured.lab.augment import symmetry_table
from gestured.lab.decide import WRONG, Answers, confidence
from gestured.lab.everyday.hours import LEVELS
from gestured.lab.fit import CLASSES, targets
from gestured.lab.samples import EVERYDAY, Samples
from gestured.simulator import GESTURES, NONE

# Lost gestures that weigh as much as one false gesture, on a day with some 35 meant gestures an hour. A budget of false
# ones alone would give up the taps, which everyday contact resembles most.
COSTS = dict(zip(STRICTNESS, (0.1, 0.25, 3.0), strict=True))


def operating_points(
    answers: Answers, lived: Samples, performed: int, hours: float, false_weight: float = 1.0
) -> dict[str, Any]:
    """The metadata `operating_points`, by answers to (G,) segments of so many `hours` with `performed` gestures.

    A gesture that was performed and never cut out is missed at every point. `false_weight`: how much more a false
    gesture of these hours weighs than COSTS says, where they do not hold as many gestures as a day does.
    """
    best, sure = answers[0].argmax(axis=1), confidence(answers)
    label = targets(lived)
    known, false = lived.labels != NONE, lived.kinds == EVERYDAY
    right = known & (best == label)
    # (G, L) by gesture and level: how many were right, wrong and false there
    rightly, wrongly, falsely = (_by_level(best, sure, chosen) for chosen in (right, known & ~right, false))
    groups = alike()
    found: dict[str, Any] = {}
    for name in STRICTNESS:
        worth = rightly - WRONG * wrongly - COSTS[name] * false_weight * falsely
        level = np.array([int(worth[group].sum(axis=0).argmax()) for group in groups])
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
    """(G, L) by gesture, how many chosen segments are named so with a confidence of at least each of LEVELS."""
    counts = [(sure[chosen & (best == g)][:, None] >= np.array(LEVELS)).sum(axis=0) for g in range(len(GESTURES))]
    return np.array(counts, np.int64)


def alike() -> list[list[int]]:
    """(G,) for each gesture the gestures that turns and mirrors make of it, with itself.

    No direction is meant more often than another, so a difference between the thresholds of two directions would be
    chance.
    """
    table = symmetry_table(CLASSES)[:, : len(GESTURES)]
    return [sorted({int(k) for k in column if k < len(GESTURES)}) for column in table.T]


def by_strictness(points: Mapping[str, Any]) -> str:
    """A line for each point: false gestures an hour, and the share missed."""
    return "\n".join(
        f"{name}: {points[name]['false_per_hour']:.2f} false an hour, {points[name]['missed']:.3f} missed"
        for name in STRICTNESS
    )
