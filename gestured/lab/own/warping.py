"""Dynamic time warping of position and log pressure: the usual way to compare with examples, without a network."""

import numpy as np
from numpy.typing import NDArray

from gestured.core.own import EXAMPLES
from gestured.lab.own.learn import Seen
from gestured.lab.own.play import REPETITIONS
from gestured.lab.samples import Samples
from gestured.model.features import ACTIVE

Array = NDArray[np.float64]
FLOOR = 0.12  # of the peak: below it a taxel counts for nothing
LONGEST = 60  # frames: four seconds at 15 Hz


def series(window: NDArray[np.float32]) -> Array:
    """(T, R, C) window -> (T', 3): where the contact is, about its middle, in sides of the grid; and how firm it is."""
    active = window[window.max(axis=(1, 2)) >= ACTIVE].astype(np.float64)[:LONGEST]
    if not len(active):
        return np.zeros((1, 3))
    weight = np.maximum(active - FLOOR, 0.0)
    total = weight.sum(axis=(1, 2)) + 1e-6
    rows, columns = window.shape[1:]
    down = weight.sum(axis=2) @ (np.arange(rows) / rows) / total
    across = weight.sum(axis=1) @ (np.arange(columns) / columns) / total
    found = np.stack([down, across, 0.25 * np.log(total)], axis=1)
    return np.asarray(found - found.mean(axis=0))


def distances(one: Array, others: list[Array]) -> Array:
    """Of a series to each of many: the cheapest way to walk both, a step on the average."""
    longest = max(map(len, others))
    ends = np.array([len(other) for other in others])
    padded = np.zeros((len(others), longest, 3))
    for row, other in zip(padded, others, strict=True):
        row[: len(other)] = other
    steps = np.linalg.norm(one[:, np.newaxis, np.newaxis] - padded, axis=-1)  # (T, N, longest)
    cost = np.full((len(one) + 1, longest + 1, len(others)), np.inf)
    cost[0, 0] = 0.0
    for i in range(len(one)):
        for j in range(longest):
            cheapest = np.minimum(np.minimum(cost[i, j], cost[i, j + 1]), cost[i + 1, j])
            cost[i + 1, j + 1] = steps[i, :, j] + cheapest
    return np.asarray(cost[len(one), ends, np.arange(len(others))] / (len(one) + ends))


def recalls(samples: Samples, seen: Seen, kinds: tuple[str, ...], accepted: float) -> dict[int, float]:
    """By the number of examples: recall of new gestures where that share of what else the person does is accepted.

    The threshold is the best there is for these very people, which favours it.
    """
    every = [series(samples.window(i)) for i in range(len(samples))]
    near: dict[int, tuple[list[Array], list[Array]]] = {count: ([], []) for count in range(1, EXAMPLES + 1)}
    plan, _ = seen.plans()
    gestures = np.isin(seen.labels, seen.gestures)
    for person in np.unique(seen.people):
        his = seen.people == person
        for kind in kinds:
            mine = np.flatnonzero(his & plan & (seen.kinds == kind))
            if len(mine) < REPETITIONS - 2:
                continue
            others = np.flatnonzero(his & ~gestures & (seen.kinds != kind))[::4]  # a part of them is enough
            asked = [every[i] for i in (*mine[EXAMPLES:], *others)]
            each = np.stack([distances(every[i], asked) for i in mine[:EXAMPLES]])
            for count, (again, else_) in near.items():
                best = -each[:count].min(axis=0)
                again.append(best[: len(mine) - EXAMPLES])
                else_.append(best[len(mine) - EXAMPLES :])
    found = {}
    for count, (again, else_) in near.items():
        least = np.quantile(np.concatenate(else_), 1.0 - accepted)
        found[count] = float((np.concatenate(again) >= least).mean())
    return found
