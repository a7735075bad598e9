"""Where a method fails, from the answers of several seeds."""

import numpy as np
import pytest

from gestured.lab.study.failures import failures
from gestured.lab.study.protocols import Result
from gestured.lab.study.tables import pooled

NAMES = np.array(["swipe", "circle", "tap"] * 4)  # of twelve gestures, in the cohort's order


def result(seed: int) -> Result:
    """All gestures in an order of the seed's; taps are wrong, and with the first seed circles, too."""
    source = np.random.default_rng(seed).permutation(len(NAMES))
    bad = ["tap", "circle"] if seed == 0 else ["tap"]
    predicted = [int(NAMES[i] in bad) for i in source]
    return {
        "truth": [0] * len(source), "predicted": predicted, "source": source.tolist(),
        "person": (source % 4).tolist(), "train": 5, "seconds": 1.0,
    }  # fmt: skip


@pytest.mark.parametrize("seeds", [1, 2, 3])
def test_groups_are_of_all_seeds_and_count_each_gesture_once(seeds: int) -> None:
    (entry,) = failures("lstm", pooled([result(seed) for seed in range(seeds)]), {"gesture": NAMES})
    assert [group["name"] for group in entry["groups"]] == ["swipe", "circle", "tap"]
    assert [group["n"] for group in entry["groups"]] == [4, 4, 4]
    assert [group["right"] for group in entry["groups"]] == pytest.approx([1.0, 1 - 1 / seeds, 0.0], abs=1e-3)
