"""The ablation compares what it says it compares: as many takes, the kind left out, equally many wrong."""

import numpy as np

from gestured.lab.adapt.judging import Answers
from gestured.lab.dataset import from_take
from gestured.lab.samples import collect
from gestured.simulator import wide
from tests.lab.ablation import KINDS, first, of_kind, row


def test_each_sample_is_of_the_kind_of_its_take() -> None:
    count = 30
    takes = [wide(4, index) for index in range(count)]
    samples = collect(sample for take in takes for sample in from_take(take))
    wanted = {take.events[0].participant: take.sensor.noise >= 1 / 25 for take in takes}
    found = of_kind(samples, 4, count, next(iter(KINDS)))
    assert found.tolist() == [wanted[person] for person in samples.people.tolist()]
    assert 0 < found.sum() < len(found)


def test_the_first_takes_are_taken_whole() -> None:
    samples = collect(sample for index in range(12) for sample in from_take(wide(4, index)))
    people = samples.people.tolist()
    wanted = list(dict.fromkeys(people))[:5]
    assert first(samples, 5).people.tolist() == [person for person in people if person in wanted]


def test_both_are_compared_where_no_more_are_wrong() -> None:
    known, people = np.ones(4, bool), np.arange(4)
    careful = Answers(known, np.array([1, 1, 1, 0], bool), np.array([0.9, 0.8, 0.7, 0.3]), people)
    bold = Answers(known, np.array([1, 0, 1, 1], bool), np.array([0.9, 0.8, 0.7, 0.6]), people)
    cells = row("title", careful, bold, 0.5).split(" | ")
    assert cells[1:3] == ["4", "0.000"]  # gestures, and wrong ones
    assert cells[-2].startswith("0.750") and cells[-1].startswith("0.250")
