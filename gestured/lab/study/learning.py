"""How many participants it takes: right answers on people held out against how many others were learned from."""

from collections.abc import Mapping
from typing import Any

from gestured.lab.study.bootstrap import curve
from gestured.lab.study.cells import Schedule
from gestured.lab.study.material import UNCHANGED, Data
from gestured.lab.study.methods import METHODS
from gestured.lab.study.plan import Plan
from gestured.lab.study.protocols import PARTICIPANTS, Task
from gestured.lab.study.tables import right, task
from gestured.lab.study.views import Values

LEARNING_METHODS = ("tp_rf", "lstm", "cnn_lstm", "trajectory_gb")


def learning(
    plan: Plan, tuned: Mapping[str, Values], sets: Mapping[str, Data], schedule: Schedule
) -> list[dict[str, Any]]:
    """A curve for some methods, without augmentation; its last point is the participants protocol itself."""
    everybody = len(set(sets["simulated"].gestures.people.tolist()))
    all_others = everybody - -(-everybody // plan.folds)
    counts = (*plan.learning, all_others)
    if not plan.learning:
        return []

    def asked(name: str, count: int) -> Task:
        people = 0 if count == all_others else count
        return task(METHODS[name], tuned[name], UNCHANGED, PARTICIPANTS, "simulated", plan, people=people)

    tasks = {(name, count): asked(name, count) for name in LEARNING_METHODS for count in counts}
    found = schedule.results(list(tasks.values()), sets, "learning curves")
    points = {name: [found[tasks[name, count]] for count in counts] for name in LEARNING_METHODS}
    return [
        {"method": name, "participants": list(counts), **curve((right(point), point["person"]) for point in of)}
        for name, of in points.items()
    ]
