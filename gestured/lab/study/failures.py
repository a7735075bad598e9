"""Where a method fails: right answers by who gestured, how, where and how hard, participants held out."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.lab.study.bootstrap import summary
from gestured.lab.study.cohort import Cohort
from gestured.lab.study.protocols import Result
from gestured.lab.study.shifting import bounding_box
from gestured.lab.study.tables import right
from gestured.simulator import Participant

PARTS = ("low", "middle", "high")  # thirds of what is measured


def groups(cohort: Cohort) -> dict[str, NDArray[np.str_]]:
    """(G,) name of the group that each gesture belongs to, for each way of looking.

    Hand size is the simulated fingertip's width, pressure the gesture's peak in counts, place the distance from the
    sensor's middle to the middle of the bounding box, signal to noise the peak over the noise: thirds of each.
    """
    plan = cohort.trials()
    people = [Participant(trial.participant) for trial in plan]
    samples = cohort.samples
    boxes = [bounding_box(samples.window(i)) for i in range(len(samples))]
    middle = (samples.frames.shape[1] - 1) / 2
    away = np.array([np.hypot((t + b) / 2 - middle, (left + r) / 2 - middle) for t, b, left, r in boxes])
    return {
        "gesture": np.array([trial.gesture for trial in plan]),
        "speed": np.array([trial.speed for trial in plan]),
        "inclination": np.array([f"arm pose {trial.inclination + 1}" for trial in plan]),
        "participant": np.array([f"{trial.participant:02d}" for trial in plan]),
        "hand size": _thirds(np.array([person.finger_mm for person in people]), "mm"),
        "pressure": _thirds(samples.strength * cohort.noise, "counts"),
        "place": _thirds(away, "taxels from the middle"),
        "signal to noise": _thirds(samples.strength, ""),
    }


def _thirds(values: NDArray[np.float64], unit: str) -> NDArray[np.str_]:
    edges = np.quantile(values, [0.0, 1 / 3, 2 / 3, 1.0])
    at = np.searchsorted(edges[1:3], values)
    names = [
        f"{part}: {low:.3g} to {high:.3g} {unit}".strip()
        for part, low, high in zip(PARTS, edges[:-1], edges[1:], strict=True)
    ]
    return np.array(names)[at]


def failures(method: str, result: Result, by: dict[str, NDArray[np.str_]]) -> Iterator[dict[str, Any]]:
    """One entry of study.json for each way of looking. Groups count each gesture once, however many seeds there are."""
    good, source, people = right(result), np.array(result["source"]), np.array(result["person"])
    for title, names in by.items():
        of = names[source]
        rows = []
        for name in dict.fromkeys(names if title == "gesture" else sorted(set(names))):
            here = of == name
            if here.any():
                count = int(here.sum()) // len(result["shares"])
                rows.append({"name": str(name), "n": count, **summary(good[here], people[here])})
        if title in ("hand size", "pressure", "place", "signal to noise"):
            rows.sort(key=lambda row: PARTS.index(str(row["name"]).split(":")[0]))
        yield {"method": method, "by": title, "groups": rows}
