"""The rows of real recordings: each gesture counts once, and those that were never cut out count as lost."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gestured.lab import train
from gestured.lab.evaluate import outcome
from gestured.lab.fit import targets
from gestured.record.arrays import write
from tests.lab.adapt.recorded import cut_gestures


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four gestures, one of which nothing is to be seen of; and a session's file, which holds two of them again."""
    made = cut_gestures(("0", "1"), ("swipe_up", "one_tap"))
    frames = made.frames.copy()
    frames[made.offsets[1] : made.offsets[2]] = frames[made.offsets[1]]
    cut = replace(made, frames=frames, subjects=np.array([0, 0, 1, 1]), kinds=made.labels)
    again = replace(cut_gestures(("0",), ("swipe_up", "one_tap")), subjects=np.array([0, 0]), kinds=made.labels[:2])
    for name, recorded in zip(train.REAL_FILES, (cut, again), strict=True):
        write(tmp_path / name, recorded)
    return tmp_path


def test_what_was_never_cut_is_lost_and_what_is_in_both_files_counts_once(folder: Path) -> None:
    found = train._real(folder, [])
    assert found is not None
    samples, judged = found
    assert len(samples) == 5 and judged == 3
    performed = train._performed(folder)
    assert performed == {"taps and swipes": 4, "with non-gestures": 4}
    once = samples.take(np.arange(judged))
    surely = np.eye(10, dtype=np.float32)[targets(once)], np.zeros(judged, np.float32)
    result = outcome(surely, targets(once), 0.5, performed["taps and swipes"])
    assert (result.gestures, result.right, result.wrong, result.lost) == (4, 0.75, 0.0, 0.25)
