"""The main tables: how much is computed, which cells there are, and the figures of each."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.lab.dataset import TRIALS
from gestured.lab.intervals import summary
from gestured.lab.study.material import AUGMENTATIONS, SHIFT, UNCHANGED
from gestured.lab.study.methods import METHODS, Method
from gestured.lab.study.protocols import CLEAN, FOREIGN, PADDED, PAPER, PARTICIPANTS, REAL, Result, Task, values_of
from gestured.lab.study.views import Values
from gestured.simulator import GESTURES, SPEEDS, Trial
from gestured.simulator.people import INCLINATIONS


@dataclass(frozen=True)
class Plan:
    """Every number that decides how long the study takes."""

    seed: int = 0
    quick: bool = False
    seeds: int = 3  # splits and trainings of each cell of the main tables, with `seed` and those after it
    folds: int = 4  # of participants, and of real subjects
    tuning_people: int = 12  # other participants, on whom hyperparameters are compared: none of them is judged
    tuning_folds: int = 5  # as the paper says
    new_people: int = 6  # participants whom nothing has learned from: they judge error against run time
    steps: int | None = None  # batches for every network; None: as its hyperparameters say
    tuning_steps: int = 250  # batches for networks while hyperparameters are compared
    real: int | None = None  # gestures of each real subject; None: all
    timed: int = 60  # gestures that the run time is measured on, each cold (after 67 ms) and warm
    minutes: float = 20.0  # of continuous sessions for each model

    @classmethod
    def small(cls) -> "Plan":
        """A plan that takes some minutes on two cores."""
        return cls(
            quick=True, seeds=1, folds=2, tuning_people=0, new_people=1, steps=40, tuning_steps=0, real=40,
            timed=3, minutes=0.0,
        )  # fmt: skip

    def trials(self) -> NDArray[np.int64]:
        """Which of the cohort's trials are performed: all, or a third of those of every third participant."""
        chosen = [t.index for t in TRIALS if not self.quick or (t.participant % 3 == 0 and t.inclination == 1)]
        return np.array(chosen, np.int64)

    def trials_of(self, people: int) -> NDArray[np.int64]:
        """All trials of the first `people` participants of another cohort; in a quick study a third of them."""
        chosen = [t.index for t in TRIALS if t.participant < people and (not self.quick or t.inclination == 1)]
        return np.array(chosen, np.int64)


GIVEN, TUNED = "paper", "tuned"
ASKED = {"real": (REAL,), "foreign": (FOREIGN,)}  # protocols of data that are not split as the paper does


@dataclass(frozen=True)
class Cell:
    """A cell of a table."""

    method: str
    settings: str
    augmentation: str
    protocol: str
    data: str


def wanted(plan: Plan, sets: Iterable[str]) -> list[Cell]:
    """The cells of all tables of these sets of data; methods beyond the paper have tuned hyperparameters alone."""
    return [
        Cell(method.id, settings, augmentation, protocol, data)
        for method in METHODS.values()
        for settings in ((GIVEN, TUNED) if method.paper else (TUNED,))
        for data in sets
        for protocol in ASKED.get(data, (PAPER, PADDED, CLEAN, PARTICIPANTS))
        for augmentation in AUGMENTATIONS
        if not _skipped(plan, settings, protocol, augmentation)
    ]


def _skipped(plan: Plan, settings: str, protocol: str, augmentation: str) -> bool:
    if (protocol in (REAL, FOREIGN) and settings == GIVEN) or (protocol == REAL and augmentation == SHIFT):
        return True
    further = protocol == PADDED or (protocol == FOREIGN and augmentation != SHIFT)
    return plan.quick and (settings == GIVEN or further)


def tasks_of(cell: Cell, tuned: Mapping[str, Values], plan: Plan) -> list[Task]:
    """The tasks of a cell: the same with each seed."""
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
    """The row of a cell in study.json."""
    count = len(GESTURES)
    confusion = np.zeros((count, count), int)
    np.add.at(confusion, (result["truth"], result["predicted"]), 1)
    spread = float(np.std(result["shares"], ddof=1)) if len(result["shares"]) > 1 else 0.0  # over seeds
    return {
        "method": cell.method, "settings": cell.settings, "augmentation": cell.augmentation,
        "protocol": cell.protocol, "data": cell.data,
        "n": len(result["truth"]) // len(result["shares"]), **summary(right(result), result["person"]),
        "seeds": len(result["shares"]), "spread": round(spread, 4),
        "published": METHODS[cell.method].published.get(cell.augmentation) if cell.data == "simulated" else None,
        "confusion": confusion.tolist(),
    }  # fmt: skip


def by_trial(found: Mapping[Cell, Result], trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """For each method, tuned and with shifted copies, the share right of people held out, by speed and inclination.

    `trials` is what was performed, for each gesture of the simulated cohort.
    """
    speeds = np.array([trial.speed for trial in trials])
    inclinations = np.array([trial.inclination for trial in trials])
    out = []
    for cell, result in found.items():
        if (cell.settings, cell.augmentation, cell.protocol) == (TUNED, SHIFT, PARTICIPANTS):
            good, source = right(result), np.array(result["source"])
            out.append({
                "method": cell.method,
                "speed": {name: _mean(good[speeds[source] == name]) for name in SPEEDS},
                "inclination": {str(n): _mean(good[inclinations[source] == n]) for n in INCLINATIONS},
            })  # fmt: skip
    return out


def copies(found: Mapping[Cell, Result]) -> list[dict[str, Any]]:
    """How much of the gain by augmentation comes from copies of test gestures in the training set.

    `with_copy` counts test gestures, of all seeds, of which the same window is learned from, too (a shift of zero). The
    gains are of augmentation under the paper's protocol and under the clean one.
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
            "with_copy": int(same.sum()),
            "right_with_copy": _mean(good[same]), "right_without_copy": _mean(good[~same]),
            "gain_leaky": round(share(PAPER, SHIFT) - share(PAPER, UNCHANGED), 4),
            "gain_clean": round(share(CLEAN, SHIFT) - share(CLEAN, UNCHANGED), 4),
        })  # fmt: skip
    return out


def _mean(values: NDArray[np.bool_]) -> float | None:
    return round(float(values.mean()), 4) if len(values) else None
