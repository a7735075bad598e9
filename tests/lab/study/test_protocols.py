"""Who learns and who is judged: what crosses over under the paper's protocol, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from gestured.lab.intervals import interval, rate
from gestured.lab.study.material import JUDGE, SHIFT, UNCHANGED, Data
from gestured.lab.study.methods import METHODS
from gestured.lab.study.protocols import (
    CLEAN,
    FOREIGN,
    PADDED,
    PAPER,
    PARTICIPANTS,
    Task,
    material,
    run,
    splits,
    values_of,
)
from gestured.lab.study.tables import Cell, pooled, right, row
from tests.lab.study.material_made import data, samples


def task(protocol: str, augmentation: str = SHIFT, method: str = "tp_knn") -> Task:
    return Task(method, values_of(METHODS[method].grid[0]), augmentation, protocol, "simulated", 0, 3)


def test_the_papers_split_learns_from_copies_of_what_it_judges() -> None:
    found = run(task(PAPER), data())
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
    assert first == second


def test_all_windows_of_the_papers_protocol_are_equally_long() -> None:
    of, _ = material(task(PAPER), data())
    assert len(set(of.samples.lengths().tolist())) == 1
    lengths = material(task(CLEAN), data())[0].samples.lengths()
    assert len(set(lengths.tolist())) > 1
    assert set(material(task(PADDED), data())[0].samples.lengths().tolist()) == {lengths.max()}


def test_under_the_papers_protocol_alone_frames_are_a_running_average() -> None:
    gestures = data().gestures
    smooth, raw = (material(task(protocol, UNCHANGED), data())[0].samples for protocol in (PADDED, CLEAN))
    window, before = smooth.window(0), gestures.window(0)
    assert np.array_equal(raw.window(0), before)
    mean = np.stack([before[max(0, k - 1) : k + 2].mean(axis=0) for k in range(len(before))])
    assert np.allclose(window[: len(before)], mean / mean.max(), atol=2e-3) and not window[len(before) :].any()


def test_those_of_another_generator_judge_and_teach_nothing() -> None:
    of = Data.of(samples(3), samples(1))
    asked = task(FOREIGN, UNCHANGED)
    found, _ = material(asked, of)
    ((train, test),) = splits(asked, found)
    assert len(test) == len(samples(1)) and len(train) == len(samples(3))
    assert (found.source[test] == JUDGE).all() and not (found.source[train] == JUDGE).any()
    assert len(run(asked, of)["truth"]) == len(samples(1))


def test_the_seeds_of_a_cell_are_counted_as_one_figure() -> None:
    results = [run(replace(task(CLEAN, UNCHANGED), seed=seed), data()) for seed in (0, 1)]
    both = pooled(results)
    found = row(Cell("tp_knn", "tuned", UNCHANGED, CLEAN, "simulated"), both)
    assert both["shares"] == [round(float(right(one).mean()), 4) for one in results]
    assert found["right"] == pytest.approx(np.mean(both["shares"]), abs=1e-3) and found["seeds"] == 2
    assert found["n"] == len(results[0]["truth"]) and found["spread"] == pytest.approx(
        np.std(both["shares"], ddof=1), abs=1e-4
    )


@pytest.mark.parametrize("count", [6, 10, 30])
def test_an_interval_covers_the_truth_as_often_as_it_says_of_few_people_too(count: int) -> None:
    rng = np.random.default_rng(0)
    people = np.repeat(np.arange(count), 40)
    covered = covered_rate = 0
    for _ in range(500):
        skill = rng.beta(18.0, 2.0, count)
        _, low, high = interval(rng.random(40 * count) < skill[people], people)
        covered += low <= 0.9 <= high
        hours, often = np.full(count, 2.0), rng.gamma(4.0, 0.5, count)
        low, high = rate(rng.poisson(often * hours), hours)
        covered_rate += low <= 2.0 <= high
    assert 0.92 <= covered / 500 <= 0.98 and 0.92 <= covered_rate / 500 <= 0.98


def test_what_was_never_or_always_right_has_an_end_that_its_count_shows() -> None:
    people = np.repeat(np.arange(6), 10)
    assert interval(np.zeros(60, bool), people) == (0.0, 0.0, 0.05)
    assert interval(np.ones(60, bool), people) == (1.0, 0.95, 1.0)
    assert rate(np.zeros(6), np.full(6, 5.0)) == (0.0, 0.1)
