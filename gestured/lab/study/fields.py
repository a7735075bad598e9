"""How often each timed model is wrong in three fields: the simulator's people, another generator's, and real fingers.

`simulated` are new people, judged where the run time is measured. `foreign` and `real` of the study's methods are the
cells of these protocols (every gesture that was cut out is answered); of the shipped models what they publish of the
other generator's windows, and the manifest's figures of real subjects, each judged by networks that never saw it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gestured.lab.decide import confidence
from gestured.lab.evaluate import model_answers
from gestured.lab.manifest import measured
from gestured.lab.samples import WINDOW, Samples
from gestured.lab.study.material import SHIFT, UNCHANGED, classes
from gestured.lab.study.protocols import FOREIGN, REAL
from gestured.lab.study.run_time import told
from gestured.lab.study.runners import SHIPPED
from gestured.lab.study.tables import TUNED, Cell
from gestured.lab.train import REAL_SETS
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.simulator import GESTURES

SEEN = {"foreign": (FOREIGN, SHIFT), "real": (REAL, UNCHANGED)}  # protocol and augmentation of the study's own cells


def with_fields(
    rows: Sequence[Mapping[str, Any]], cells: Mapping[Cell, Mapping[str, Any]], judges: tuple[Samples, int] | None
) -> list[dict[str, Any]]:
    """The rows of run time with `fields`; `cells` as study.json has them, `judges` and how many were performed."""
    return [{**row, "fields": _fields(row, cells, judges)} for row in rows]


def _fields(
    row: Mapping[str, Any], cells: Mapping[Cell, Mapping[str, Any]], judges: tuple[Samples, int] | None
) -> dict[str, Any]:
    names = ("wrong", "wrong_low", "wrong_high", "error", "error_low", "error_high", "performed")
    found: dict[str, Any] = {"simulated": {name: row[name] for name in names}}
    if row["settings"] == "shipped":
        if judges:
            found["foreign"] = _published(SHIPPED[row["method"]], *judges)
        real = _manifest(SHIPPED[row["method"]])
        return found | ({"real": real} if real else {})
    for field, (protocol, augmentation) in SEEN.items():
        cell = cells.get(Cell(row["method"], TUNED, augmentation, protocol, field))
        if cell is not None:
            ends = {"low": 1 - cell["high"], "high": 1 - cell["low"]}
            wrong = {"wrong": 1 - cell["right"], **{f"wrong_{end}": share for end, share in ends.items()}}
            error = {name.replace("wrong", "error"): share for name, share in wrong.items()}
            found[field] = {name: round(share, 4) for name, share in (wrong | error).items()}
            found[field]["performed"] = cell["n"]
    return found


def _published(name: str, judges: Samples, performed: int) -> dict[str, Any]:
    """What a shipped model makes of windows that nothing learned from."""
    model = open_model(shipped()[name])
    if model.metadata.window != WINDOW:
        return {}
    answers = model_answers(model, judges)
    named = np.array([GESTURES.index(name) for name in model.gestures])[answers[0].argmax(axis=1)]
    said = confidence(answers) >= model.threshold
    return told(named, said, classes(judges), judges.people, performed - len(judges))


def _manifest(name: str) -> dict[str, Any] | None:
    """The manifest's figures of real subjects; one that was written by an older version has no intervals."""
    row = measured(shipped()[name]).get("real", {}).get(REAL_SETS[0])
    if row is None:
        return None
    found = {"wrong": row["wrong"], "error": row["wrong"] + row["lost"]}
    if ends := row.get("intervals"):
        wrong, right = ends["wrong"], ends["right"]
        found |= {"wrong_low": wrong["low"], "wrong_high": wrong["high"]}
        found |= {"error_low": 1 - right["high"], "error_high": 1 - right["low"]}
    return {name: round(share, 4) for name, share in found.items()} | {"performed": row["gestures"]}
