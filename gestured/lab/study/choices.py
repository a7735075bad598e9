"""Hyperparameters, and what the paper leaves open: our choice, its alternatives, and how much it matters.

Hyperparameters are compared by cross-validation with participants left out, on people who are not judged anywhere else
(`cohort.TUNING_SEED`); the paper compares them on those whom it judges. The grids are coarse and small. Networks are
compared after fewer batches than they are trained for afterwards. What wins without augmentation is used with it too,
unlike in the paper (its Table IV has two columns).

Each choice is varied alone, the rest as in the tuned setting; participants held out and no augmentation, except if it
belongs to the paper's protocol (its length of all windows, the bounding box of its Algorithm 1).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gestured.lab.intervals import summary
from gestured.lab.samples import WINDOW, Samples
from gestured.lab.study.cells import Schedule
from gestured.lab.study.cohort import Cohort
from gestured.lab.study.material import SHIFT, THRESHOLD, UNCHANGED, Data
from gestured.lab.study.methods import METHODS
from gestured.lab.study.protocols import LENGTH, PAPER, PARTICIPANTS, Task
from gestured.lab.study.tables import Plan, right, task
from gestured.lab.study.views import POOLED, TAXELS, Values

WAVELET_NAMES, WAVELET_LEVELS = ("haar", "db2", "db4", "sym4"), (1, 2, 3, 4)
READINGS = {
    TAXELS: "statistics of each taxel, and over all taxels",
    POOLED: "mean, maximum and variance over all taxels",
}
DECAYS_S = {0.0: "the whole gesture", 0.5: "0.5 s", 1.0: "1 s", 2.0: "2 s"}
CHANNELS = (4, 8)
AVERAGES = (1, 2, 3, 5)
BOXES = (0.0, 0.05, 0.2, 0.4)
LENGTHS = {0.5: "median", 0.9: "90th percentile", 1.0: "longest"}


@dataclass(frozen=True)
class Choice:
    """One choice that the paper leaves open, and a task for each alternative."""

    choice: str
    ours: str
    method: str
    tasks: Mapping[str, Task]


def variants(cohort: Cohort) -> dict[str, Data]:
    """The cohort through other windows: running averages, and other ways to scale pressure."""
    out = {
        f"average-{n}": Data.of(cohort.windows(replace(WINDOW, smooth_frames=n)))
        for n in AVERAGES if n != WINDOW.smooth_frames
    }  # fmt: skip
    samples = cohort.samples
    peaks = samples.strength * cohort.noise  # counts
    by_count = np.repeat(peaks / np.median(peaks), samples.lengths())[:, None, None]
    own_peak = np.maximum(samples.frames.astype(np.float32).max(axis=(1, 2), keepdims=True), 0.05)
    out["counts"] = Data.of(_scaled(samples, by_count))
    out["each frame"] = Data.of(_scaled(samples, 1 / own_peak))
    return out


def _scaled(samples: Samples, factor: Any) -> Samples:
    return replace(samples, frames=(samples.frames.astype(np.float32) * factor).astype(np.float16))


def wanted_choices(plan: Plan, tuned: Mapping[str, Values]) -> Iterator[Choice]:
    """Every choice with its tasks."""

    def alone(method: str, data: str = "simulated", **changed: Any) -> Task:
        return task(METHODS[method], {**tuned[method], **changed}, UNCHANGED, PARTICIPANTS, data, plan)

    def leaky(augmentation: str, **changed: Any) -> Task:
        return replace(task(METHODS["lstm"], tuned["lstm"], augmentation, PAPER, "simulated", plan), **changed)

    yield Choice("wavelet", "haar", "st_rf", {name: alone("st_rf", wavelet=name) for name in WAVELET_NAMES})
    yield Choice("wavelet level", "3", "st_rf", {str(n): alone("st_rf", level=n) for n in WAVELET_LEVELS})
    readings = {words: alone("st_rf", reading=name) for name, words in READINGS.items()}
    yield Choice("what the wavelet features are", READINGS[TAXELS], "st_rf", readings)
    decays = {name: alone("mhi_cnn", decay_s=s) for s, name in DECAYS_S.items()}
    yield Choice("decay of the motion history image", DECAYS_S[0.0], "mhi_cnn", decays)
    widths = {f"{n} and {2 * n} channels": alone("cnn_lstm", channels=n) for n in CHANNELS}
    yield Choice("widths of the convolutions", "8 and 16 channels", "cnn_lstm", widths)
    units = {f"{n} units": alone("lstm", units=n) for n in (16, 32, 64)}
    yield Choice("width of the recurrent layer", f"{tuned['lstm']['units']} units", "lstm", units)
    averages = {
        _frames(n): alone("lstm", "simulated" if n == WINDOW.smooth_frames else f"average-{n}") for n in AVERAGES
    }
    yield Choice("length of the running average", _frames(WINDOW.smooth_frames), "lstm", averages)
    scales = {
        "gesture's own peak": "simulated",
        "counts of the sensor": "counts",
        "each frame's own peak": "each frame",
    }
    scaled = {title: alone("lstm", data) for title, data in scales.items()}
    yield Choice("normalisation of pressure", "gesture's own peak", "lstm", scaled)
    boxes = {f"above {b:g} of the peak": leaky(SHIFT, box=b) for b in BOXES}
    yield Choice(
        "what is in the bounding box (paper's protocol, shifted)", f"above {THRESHOLD:g} of the peak", "lstm", boxes
    )
    lengths = {name: leaky(UNCHANGED, length=q) for q, name in LENGTHS.items()}
    yield Choice("length of all windows (paper's protocol)", LENGTHS[LENGTH], "lstm", lengths)


def _frames(count: int) -> str:
    return "none" if count == 1 else f"{count} frames"


def choices(
    plan: Plan, tuned: Mapping[str, Values], cohort: Cohort, sets: Mapping[str, Data], schedule: Schedule
) -> list[dict[str, Any]]:
    """The section `choices` of study.json."""
    asked = list(wanted_choices(plan, tuned))
    tasks = [one for choice in asked for one in choice.tasks.values()]
    found = schedule.results(tasks, {**sets, **variants(cohort)}, "open choices")
    out = []
    for choice in asked:
        results = {value: found[task] for value, task in choice.tasks.items()}
        rows = [{"value": value, **summary(right(of), of["person"])} for value, of in results.items()]
        told = {"choice": choice.choice, "ours": choice.ours, "method": choice.method}
        out.append({**told, "alternatives": rows})
    return out


TUNING = "tuning"  # the name of the data


def tune(plan: Plan, people: Data | None, schedule: Schedule) -> dict[str, Values]:
    """The best hyperparameters of each method on `people`; without people the first."""
    if people is None:
        return {method.id: method.grid[0] for method in METHODS.values()}
    asked: dict[tuple[str, int], Task] = {}
    for method in METHODS.values():
        for k, values in enumerate(method.grid):
            shorter = {**values, "steps": plan.tuning_steps} if method.network else values
            one = task(method, shorter, UNCHANGED, PARTICIPANTS, TUNING, plan)
            asked[method.id, k] = replace(one, folds=plan.tuning_folds)
    found = schedule.results(list(asked.values()), {TUNING: people}, "hyperparameters")
    shares = {key: right(found[of]).mean() for key, of in asked.items()}
    best = {method: max((key for key in asked if key[0] == method), key=shares.__getitem__) for method in METHODS}
    return {method: METHODS[method].grid[k] for method, k in best.values()}
