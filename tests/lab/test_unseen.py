"""Networks that must not know some kinds of non-gestures have never seen one."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.unseen import GROUPS, Said, group_of, rejected, untaught, without_kinds
from gestured.lab.augment import symmetry_table
from gestured.lab.dataset import OTHER_TRIALS, STREAMS, TRIALS
from gestured.lab.fit import CLASSES, targets
from gestured.lab.samples import EVERYDAY, Samples, collect
from gestured.lab.train import TrainingData
from gestured.simulator import GESTURES, NONE


@pytest.fixture(scope="module")
def samples() -> Samples:
    spread = {"cohort": range(0, len(TRIALS), 90), "others": range(0, len(OTHER_TRIALS), 30)}
    return collect(s for stream, indices in spread.items() for i in indices for s in STREAMS[stream](0, i))


def test_every_kind_that_is_performed_and_no_gesture_is_in_one_group() -> None:
    found = [k for number in range(len(GROUPS)) for k in group_of(number)]
    assert sorted(found) == [k for k in range(len(GESTURES), len(CLASSES)) if CLASSES[k] != EVERYDAY]


@pytest.mark.parametrize("number", range(len(GROUPS)))
def test_no_symmetry_makes_a_kind_that_was_left_out(number: int) -> None:
    left = untaught(group_of(number))
    table = symmetry_table(CLASSES).numpy()
    taught = np.delete(np.arange(len(CLASSES)), left)
    assert not np.isin(table[:, taught], left).any()
    for k in set(group_of(number)) - set(left):  # and none stays in that could be left out
        assert CLASSES[k].startswith("two_finger_swipe")
    assert len(left) >= 10


def test_what_is_left_out_teaches_and_calibrates_nothing_and_still_judges(samples: Samples) -> None:
    real = replace(samples, kinds=np.where(samples.kinds == "long_press", "tap_hold", samples.kinds))
    data = TrainingData(samples, 60, samples, {"nominal": samples}, {"nominal": 40}, real, 90)
    classes = untaught(group_of(len(GROUPS) - 1))
    assert CLASSES.index("long_press") in classes
    less = without_kinds(data, classes)
    assert less.real is not None
    for part, whole in ((less.teach, data.teach), (less.calibrate, data.calibrate), (less.real, real)):
        gone = np.isin(targets(whole), classes)
        assert gone.any() and not np.isin(targets(part), classes).any()
        assert part.digest() == whole.take(~gone).digest()  # and nothing else is gone
    last = targets(samples)[-60:]
    assert less.nominal == (~np.isin(last, classes)).sum()
    assert less.real_judged == (~np.isin(targets(real)[:90], classes)).sum()
    assert less.tests is data.tests


def test_rejected_counts_the_kinds_that_are_asked_after_alone(samples: Samples) -> None:
    classes = group_of(0)
    scores = np.zeros((len(samples), len(GESTURES)), np.float32)
    scores[:, 0] = 1.0
    asked = np.isin(targets(samples), classes)
    arc = samples.kinds == "arc"
    unknown = np.where(asked & ~arc, 1.0, 0.0).astype(np.float32)  # all of them but arcs are rejected
    said = Said("nominal", (scores, unknown), samples, 0.5, classes)
    found = rejected([said])
    assert found["count"] == asked.sum() and (samples.labels[asked] == NONE).all()
    assert found["rejected"] == pytest.approx(1 - arc.sum() / asked.sum())
    assert found["kinds"]["arc"] == 0 and sorted(found["kinds"]) == sorted(set(samples.kinds[asked]))
    judged = said.judged(performed=1000)
    assert (judged.gestures, judged.others) == (1000, found["count"])
    assert judged.rejected == pytest.approx(found["rejected"])
