"""Hyperparameters by cross-validation with participants left out, on people who are not judged anywhere else.

They are another cohort's (`cohort.TUNING_SEED`), with their gestures as they are. The paper compares hyperparameters on
the people whom it judges. The grids are coarse and small. Networks are compared after fewer batches than they are
trained for afterwards. What wins without augmentation is used with it too, which the paper does not (its Table IV has
two columns).
"""

from dataclasses import replace
from typing import Any

import numpy as np

from gestured.lab.study.cells import Schedule
from gestured.lab.study.material import UNCHANGED, Data
from gestured.lab.study.methods import METHODS
from gestured.lab.study.plan import Plan
from gestured.lab.study.protocols import PARTICIPANTS, Result, Task
from gestured.lab.study.tables import right, task
from gestured.lab.study.views import Values

TUNING = "tuning"  # the name of the data


def tune(plan: Plan, people: Data | None, schedule: Schedule) -> tuple[dict[str, Values], list[dict[str, Any]]]:
    """The best hyperparameters of each method on `people`, and every candidate's figures; the first ones without."""
    if people is None:
        return {method.id: method.grid[0] for method in METHODS.values()}, []
    asked: dict[tuple[str, int], tuple[Values, Task]] = {}
    for method in METHODS.values():
        for values in method.grid:
            shorter = {**values, "steps": plan.tuning_steps} if method.network else values
            asked[method.id, len(asked)] = (
                values,
                replace(task(method, shorter, UNCHANGED, PARTICIPANTS, TUNING, plan), folds=plan.tuning_folds),
            )
    found = schedule.results([item[1] for item in asked.values()], {TUNING: people}, "hyperparameters")
    chosen: dict[str, Values] = {}
    rows = []
    for method in METHODS.values():
        candidates: list[dict[str, Any]] = [
            {"values": dict(values), **_figures(found[of])}
            for (name, _), (values, of) in asked.items()
            if name == method.id
        ]
        best = max(candidates, key=lambda c: float(c["right"]))
        chosen[method.id] = best["values"]
        rows.append({"method": method.id, "candidates": candidates, "chosen": best["values"]})
    return chosen, rows


def _figures(result: Result) -> dict[str, float]:
    """Share right, and its standard deviation between folds."""
    good, fold = right(result), np.array(result["fold"])
    shares = [good[fold == k].mean() for k in np.unique(fold)]
    return {"right": round(float(good.mean()), 4), "spread": round(float(np.std(shares)), 4)}
