"""The main tables: which cells there are, and what each says."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.lab.intervals import summary
from gestured.lab.study.material import AUGMENTATIONS, SHIFT, UNCHANGED, Data
from gestured.lab.study.methods import METHODS, Method
from gestured.lab.study.plan import Plan
from gestured.lab.study.protocols import CLEAN, FOREIGN, PADDED, PAPER, PARTICIPANTS, REAL, Result, Task, values_of
from gestured.lab.study.views import Values
from gestured.simulator import GESTURES

GIVEN, TUNED = "paper", "tuned"
ASKED = {"real": (REAL,), "foreign": (FOREIGN,)}  # protocols of data that are not split as the paper does


@dataclass(frozen=True)
class Cell:
    """A place in a table."""

    method: str
    settings: str
    augmentation: str
    protocol: str
    data: str


def wanted(plan: Plan, sets: Mapping[str, Data]) -> list[Cell]:
    """The cells of all tables; what goes beyond the paper has tuned hyperparameters alone."""
    cells = []
    for method in METHODS.values():
        for settings in (GIVEN, TUNED) if method.paper else (TUNED,):
            for data in sets.values():
                for protocol in ASKED.get(data.name, (PAPER, PADDED, CLEAN, PARTICIPANTS)):
                    for augmentation in AUGMENTATIONS:
                        if _skipped(plan, settings, protocol, augmentation):
                            continue
                        cells.append(Cell(method.id, settings, augmentation, protocol, data.name))
    return cells


def _skipped(plan: Plan, settings: str, protocol: str, augmentation: str) -> bool:
    if protocol == REAL and (augmentation == SHIFT or settings == GIVEN):
        return True
    if protocol == FOREIGN and settings == GIVEN:
        return True
    further = protocol == PADDED or (protocol == FOREIGN and augmentation != SHIFT)
    return plan.quick and (settings == GIVEN or further)


def tasks_of(cell: Cell, tuned: Mapping[str, Values], plan: Plan) -> list[Task]:
    """What has to be computed for a cell: the same with each seed."""
    method, values = METHODS[cell.method], tuned[cell.method]
    if cell.settings == GIVEN:
        assert method.paper is not None
        values = method.paper[cell.augmentation]
    first = task(method, values, cell.augmentation, cell.protocol, cell.data, plan)
    return [replace(first, seed=plan.seed + k) for k in range(plan.seeds)]


def pooled(results: Sequence[Result]) -> Result:
    """The results of a cell's seeds as one: all answers, one seed's after the other's, and the share right of each."""
    lists = {key for key, value in results[0].items() if isinstance(value, list)}
    return {
        **{key: [item for result in results for item in result[key]] for key in lists},
        "train": results[0]["train"],
        "seconds": round(sum(result["seconds"] for result in results) / len(results), 3),
        "shares": [round(float(right(result).mean()), 4) for result in results],
    }


def task(method: Method, values: Values, augmentation: str, protocol: str, data: str, plan: Plan) -> Task:
    """A task with the plan's seed, folds and batches."""
    chosen = dict(values)
    if plan.steps is not None and method.network:
        chosen["steps"] = plan.steps
    return Task(method.id, values_of(chosen), augmentation, protocol, data, plan.seed, plan.folds)


def right(result: Result) -> NDArray[np.bool_]:
    """(n,) whether each answer of a result was right."""
    same: NDArray[np.bool_] = np.equal(result["truth"], result["predicted"])
    return same


def row(cell: Cell, result: Result) -> dict[str, Any]:
    """A cell as study.json has it."""
    count = len(GESTURES)
    confusion = np.zeros((count, count), int)
    np.add.at(confusion, (result["truth"], result["predicted"]), 1)
    return {
        "method": cell.method, "settings": cell.settings, "augmentation": cell.augmentation,
        "protocol": cell.protocol, "data": cell.data,
        "n": len(result["truth"]) // len(result["shares"]), **summary(right(result), result["person"]),
        "seeds": len(result["shares"]), "spread": round(_spread(result["shares"]), 4),
        "published": METHODS[cell.method].published.get(cell.augmentation) if cell.data == "simulated" else None,
        "train": result["train"], "seconds": result["seconds"], "confusion": confusion.tolist(),
    }  # fmt: skip


def _spread(shares: Sequence[float]) -> float:
    """The standard deviation over seeds; 0 of one."""
    return float(np.std(shares, ddof=1)) if len(shares) > 1 else 0.0


def copies(found: Mapping[Cell, Result]) -> list[dict[str, Any]]:
    """How much of the gain by augmentation comes from copies of test gestures in the training set.

    `with_copy` counts test gestures, of all seeds, whose very same window is learned from too (a shift of zero),
    `with_version` those of which any other version is. The gains are of augmentation under the paper's protocol and
    under the clean one.
    """
    out = []
    for cell, result in found.items():
        if (cell.protocol, cell.augmentation, cell.data) != (PAPER, SHIFT, "simulated"):
            continue

        def share(protocol: str, augmentation: str, of: Cell = cell) -> float:
            return float(right(found[Cell(of.method, of.settings, augmentation, protocol, of.data)]).mean())

        good, same = right(result), np.array(result["same"])
        out.append({
            "method": cell.method, "settings": cell.settings, "test": len(good),
            "with_copy": int(same.sum()), "with_version": int(np.sum(result["version"])),
            "right_with_copy": _mean(good[same]), "right_without_copy": _mean(good[~same]),
            "gain_leaky": round(share(PAPER, SHIFT) - share(PAPER, UNCHANGED), 4),
            "gain_clean": round(share(CLEAN, SHIFT) - share(CLEAN, UNCHANGED), 4),
        })  # fmt: skip
    return out


def _mean(values: NDArray[np.bool_]) -> float | None:
    return round(float(values.mean()), 4) if len(values) else None
