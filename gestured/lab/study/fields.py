"""How often each timed model is wrong in three fields: the simulator's people, another generator's, and real fingers.

`simulated` are new people, judged where the run time is measured. `foreign` and `real` of the study's methods are the
cells of these protocols (every gesture that was cut out is answered); of the shipped models what they publish of the
other generator's windows, and the manifest's figures of real subjects, each judged by networks that never saw it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from gestured.lab.evaluate import model_answers, outcome
from gestured.lab.manifest import measured
from gestured.lab.samples import WINDOW, Samples
from gestured.lab.study.material import SHIFT, UNCHANGED, classes
from gestured.lab.study.protocols import FOREIGN, REAL
from gestured.lab.study.runners import SHIPPED
from gestured.lab.study.tables import TUNED, Cell
from gestured.lab.train import REAL_SETS
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.simulator import GESTURES

SEEN = {"foreign": (FOREIGN, SHIFT), "real": (REAL, UNCHANGED)}  # protocol and augmentation of the study's own cells


def field_of(evaluation: Mapping[str, Any]) -> dict[str, Any]:
    """Of an `Evaluation` as JSON has it: the gestures said wrongly, and those said wrongly or lost, with intervals."""
    right, wrong = (
        [evaluation[name], *(evaluation["intervals"][name][end] for end in ("low", "high"))]
        for name in ("right", "wrong")
    )
    error = [1 - right[0], 1 - right[2], 1 - right[1]]
    shares = {"wrong": wrong, "error": error}
    ends = {f"{name}{end}": of[k] for name, of in shares.items() for k, end in enumerate(("", "_low", "_high"))}
    return {name: round(share, 4) for name, share in ends.items()} | {"performed": evaluation["gestures"]}


def with_fields(
    rows: Sequence[Mapping[str, Any]], cells: Mapping[Cell, Mapping[str, Any]], judges: tuple[Samples, int] | None
) -> list[dict[str, Any]]:
    """The rows of run time with all fields; `cells` as study.json has them, `judges` and how many were performed."""
    return [{**row, "fields": row["fields"] | _others(row, cells, judges)} for row in rows]


def _others(
    row: Mapping[str, Any], cells: Mapping[Cell, Mapping[str, Any]], judges: tuple[Samples, int] | None
) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if row["settings"] == "shipped":
        path = shipped()[SHIPPED[row["method"]]]
        model = open_model(path)
        if judges and model.metadata.window == WINDOW and model.gestures == tuple(GESTURES):
            samples, performed = judges
            answers = model_answers(model, samples)
            judged = outcome(answers, classes(samples), model.threshold, performed, samples.people)
            found["foreign"] = field_of(asdict(judged))
        if real := measured(path).get("real", {}).get(REAL_SETS[0]):
            found["real"] = field_of(real)
        return found
    for field, (protocol, augmentation) in SEEN.items():
        if cell := cells.get(Cell(row["method"], TUNED, augmentation, protocol, field)):
            wrong = {"low": 1 - cell["high"], "high": 1 - cell["low"]}
            ends = {"wrong": wrong, "right": cell}
            found[field] = field_of({**cell, "wrong": 1 - cell["right"], "gestures": cell["n"], "intervals": ends})
    return found
