"""Who learns and who is judged: what crosses over under the paper's protocol, and nowhere else."""

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("pywt")

from gestured.lab.study.bootstrap import interval
from gestured.lab.study.material import SHIFT, UNCHANGED
from gestured.lab.study.methods import METHODS
from gestured.lab.study.protocols import CLEAN, PAPER, PARTICIPANTS, Task, material, run, splits, values_of
from tests.lab.study.material_made import data


def task(protocol: str, augmentation: str = SHIFT, method: str = "tp_knn", **more: int) -> Task:
    return Task(method, values_of(METHODS[method].grid[0]), augmentation, protocol, "simulated", 0, 3, **more)


def test_the_papers_split_learns_from_copies_of_what_it_judges() -> None:
    found = run(task(PAPER), data())
    assert np.mean(found["version"]) > 0.9
    assert 0 < np.sum(found["same"]) < len(found["same"])
    assert np.mean(np.array(found["predicted"]) == found["truth"]) > 0.5


@pytest.mark.parametrize("protocol", [CLEAN, PARTICIPANTS])
def test_no_other_protocol_does(protocol: str) -> None:
    asked = task(protocol)
    of, _ = material(asked, data())
    for train, test in splits(asked, of):
        assert not set(of.source[train]) & set(of.source[test])
        assert (test < of.gestures).all()  # what is judged is never a copy
        if protocol == PARTICIPANTS:
            assert not set(of.samples.people[train]) & set(of.samples.people[test])


def test_everybody_is_judged_once_and_the_same_on_every_run() -> None:
    first, second = (run(task(PARTICIPANTS, UNCHANGED), data()) for _ in range(2))
    assert sorted(first["source"]) == list(range(len(data().gestures)))
    assert {**first, "seconds": 0} == {**second, "seconds": 0}


def test_learning_from_fewer_people() -> None:
    of, _ = material(task(PARTICIPANTS, people=2), data())
    for train, _ in splits(task(PARTICIPANTS, people=2), of):
        assert len(set(of.samples.people[train])) == 2


def test_all_windows_of_the_papers_protocol_are_equally_long() -> None:
    of, _ = material(task(PAPER), data())
    assert len(set(of.samples.lengths().tolist())) == 1
    assert len(set(material(task(CLEAN), data())[0].samples.lengths().tolist())) > 1


def test_an_interval_is_over_people_and_not_over_gestures() -> None:
    right = np.array([1, 1, 1, 1, 0, 0, 0, 0], bool)
    share, low, high = interval(right, [0, 0, 0, 0, 1, 1, 1, 1])
    assert (share, low, high) == (0.5, 0.0, 1.0)
    share, low, high = interval(right, [0, 1, 2, 3, 0, 1, 2, 3])
    assert share == low == high == 0.5


def test_an_interval_covers_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    covered = 0
    for k in range(200):
        skill = np.clip(rng.normal(0.8, 0.1, 30), 0, 1)
        people = np.repeat(np.arange(30), 40)
        _, low, high = interval(rng.random(1200) < skill[people], people, seed=k)
        covered += low <= 0.8 <= high
    assert 0.88 <= covered / 200 <= 0.99
