"""Who learns and who is judged. One `Task` is one cell of a table; `run` computes it from the data alone.

paper         85/15 by gesture, augmented before the split, filtered by a running average, padded or cut to equal
              length: copies of test gestures are learned from, and padding is part of every input. The paper says
              neither that it augments before it splits (we infer it from its figures) nor how long its average is
              (ours: 3 frames) or its windows are (ours: the 90th percentile of all gestures).
padded        the same, but padded to the longest gesture, so that nothing is cut off
clean         85/15 by gesture, split first; only the training part is augmented; every window has its own length
participants  whole participants are held out, in folds: everybody is judged once, by models that have never seen them
real          the same with the subjects of real recordings
foreign       learned from all participants, judged on hands and sensors of another generator, which teaches nothing
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.lab.study.material import JUDGE, SHIFT, THRESHOLD, Data, Form, Pool, pool
from gestured.lab.study.methods import METHODS, Estimator
from gestured.lab.study.training import Indices, Net
from gestured.lab.study.views import View
from gestured.simulator import GESTURES

PAPER, PADDED, CLEAN, PARTICIPANTS, REAL, FOREIGN = "paper", "padded", "clean", "participants", "real", "foreign"
LEAKY = (PAPER, PADDED)  # protocols that augment before they split
HELD_OUT = 0.15
LENGTH = 0.9  # quantile of the lengths
AVERAGE_FRAMES = 3  # of the running average under the paper's protocol
Result = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """One cell: its method, hyperparameters and data; `data` is the name of a set."""

    method: str
    values: tuple[tuple[str, Any], ...]  # hyperparameters, sorted
    augmentation: str
    protocol: str
    data: str
    seed: int
    folds: int
    length: float = LENGTH  # of all windows in the paper's protocol: this quantile of the gestures' lengths
    box: float = THRESHOLD  # of the peak: what is in Algorithm 1's bounding box


def values_of(values: Any) -> tuple[tuple[str, Any], ...]:
    """Hyperparameters as a task holds them."""
    return tuple(sorted(dict(values).items()))


def _form(task: Task, data: Data) -> Form:
    """What the paper's protocol does to all windows; in others each keeps its length, and is not filtered."""
    if task.protocol not in LEAKY:
        return Form()
    share = 1.0 if task.protocol == PADDED else task.length
    return Form(int(np.quantile(data.gestures.lengths(), share)), AVERAGE_FRAMES)


@lru_cache(maxsize=6)
def _inputs(
    data: Data, augmentation: str, form: Form, box: float, view: View, prepared: tuple[tuple[str, Any], ...]
) -> Any:
    return view.all(pool(data, augmentation, form, box).samples, dict(prepared), form.frames > 0)


def material(task: Task, data: Data) -> tuple[Pool, Any]:
    """The pool of a task, and its method's view of it."""
    form = _form(task, data)
    view = METHODS[task.method].view
    prepared = tuple(item for item in task.values if item[0] in view.by)
    of = pool(data, task.augmentation, form, task.box)
    return of, _inputs(data, task.augmentation, form, task.box, view, prepared)


def splits(task: Task, of: Pool) -> Iterator[tuple[Indices, Indices]]:
    """(training, test) indices into the pool, fold by fold."""
    rng = np.random.default_rng([task.seed, 0x59])
    if task.protocol == FOREIGN:
        yield np.flatnonzero(of.source != JUDGE), np.flatnonzero(of.source == JUDGE)
        return
    if task.protocol in LEAKY:
        order = rng.permutation(len(of.labels))
        count = round(HELD_OUT * len(order))
        yield order[count:], order[:count]
        return
    if task.protocol == CLEAN:
        order = rng.permutation(of.gestures)
        held = order[: round(HELD_OUT * len(order))]
        yield np.flatnonzero(~np.isin(of.source, held)), held
        return
    people = of.samples.people[: of.gestures]
    everybody = rng.permutation(np.unique(people))
    for fold in np.array_split(everybody, min(task.folds, len(everybody))):
        yield np.flatnonzero(~np.isin(people[of.source], fold)), np.flatnonzero(np.isin(people, fold))


def fitted(task: Task, inputs: Any, train: Indices, labels: NDArray[np.int64]) -> Estimator | Net:
    """The task's method, fitted to a part of its inputs."""
    return METHODS[task.method].fit(inputs, train, labels, len(GESTURES), dict(task.values), task.seed)


def run(task: Task, data: Data) -> Result:
    """Every judged gesture of a cell: its person, its class, and the class that it was taken for.

    `same` (protocols that augment before they split): whether the very same window was learned from.
    """
    of, inputs = material(task, data)
    found: dict[str, list[Any]] = {n: [] for n in ("source", "person", "truth", "predicted", "same")}
    for train, test in splits(task, of):
        scores = fitted(task, inputs, train, of.labels).scores(inputs, test)
        found["source"] += of.source[test].tolist()
        found["person"] += of.samples.people[test].tolist()
        found["truth"] += of.labels[test].tolist()
        found["predicted"] += scores.argmax(axis=1).tolist()
        if task.protocol in LEAKY and task.augmentation == SHIFT:
            itself = of.source[train][of.same[train]]  # gestures that are learned from as they are
            found["same"] += (of.same[test] & np.isin(of.source[test], itself)).tolist()
    return found
