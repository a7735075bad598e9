"""The shipped networks on fixed people and sensors of the foreign generator, from which nothing learns.

The bounds are what a model that is worse breaks: one that names every eighth gesture otherwise does not pass.

Real recordings are no part of this gate. The shipped networks have learned from all ten subjects of those that there
are, so their answers to these would say nothing. The networks that left a third of the subjects out each are not
shipped: they lie in the cache of the training, where `gestured-lab evaluate` judges each subject by the one that has
not seen it (the rows *real* in the models' cards). A gate on real people needs people whom no training was given.
"""

import sys
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from experiments.foreign import GESTURES, NON_GESTURES, take
from experiments.foreign import judge as foreign
from experiments.foreign.judge import Take, evaluated, judge, visible
from gestured.core.classifier import Classifier, Scores
from gestured.core.frames import Segment
from gestured.model.opening import open_model
from gestured.model.shipped import shipped

SEEDS = range(9000, 9006)  # of each kind; `judge` counts from 0 unless told
BOUNDS = {  # least right, most wrong of the gestures, least rejected of the others
    ("cnn_lstm", "nominal"): (0.95, 0.02, 0.8),
    ("cnn_lstm", "hard"): (0.8, 0.01, 0.95),  # it was 0.82, 0.04, 0.8 before the models learned to keep silent
    ("lstm", "nominal"): (0.93, 0.04, 0.7),
    ("lstm", "hard"): (0.74, 0.01, 0.95),  # 0.76 for the models before these, whose default was worse
}


@cache
def takes(level: str) -> list[Take]:
    made = [take(kind, seed, level) for kind in (*GESTURES, *NON_GESTURES[::4]) for seed in SEEDS]
    return [one for one in made if visible(one)]


def figures(classifier: Classifier, level: str) -> tuple[float, float, float]:
    """Right and wrong of the gestures, rejected of the others."""
    found = evaluated([judge(one, classifier) for one in takes(level)])
    return found.right, found.wrong, found.rejected


def passes(classifier: Classifier, name: str, level: str) -> tuple[bool, str]:
    least, most, rejected = BOUNDS[name, level]
    found = figures(classifier, level)
    words = f"{name}, {level}: right {found[0]:.3f}, wrong {found[1]:.3f}, rejected {found[2]:.3f}"
    return found[0] >= least and found[1] <= most and found[2] >= rejected, words


@pytest.mark.parametrize(("name", "level"), BOUNDS)
def test_a_shipped_network_is_as_good_as_it_was(name: str, level: str) -> None:
    good, words = passes(open_model(name), name, level)
    print(words)
    assert good, f"{words}; expected {BOUNDS[name, level]}"


@dataclass
class Damaged:
    """A model that names every eighth segment otherwise, as sure as before."""

    model: Classifier
    asked: int = 0

    @property
    def gestures(self) -> tuple[str, ...]:
        return self.model.gestures

    def classify(self, segment: Segment) -> Scores:
        found = self.model.classify(segment)
        self.asked += 1
        return replace(found, values=np.roll(found.values, 1)) if self.asked % 8 == 0 else found

    def preview(self, segment: Segment) -> Scores | None:
        return None


@pytest.mark.parametrize("level", ["nominal", "hard"])
def test_a_model_that_is_worse_does_not_pass(level: str) -> None:
    good, words = passes(Damaged(open_model("cnn_lstm")), "cnn_lstm", level)
    assert not good, words


def test_the_table_of_a_document_and_of_the_cards_is_renewed(
    shelf: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    documents = [Path("figures.md"), *(path.with_suffix(".md") for path in shipped().values())]
    for document in documents:
        document.write_text("before\n<!-- judged: begin -->\nold\n<!-- judged: end -->\nafter\n")
    monkeypatch.setattr(sys, "argv", "judge --n 1 --level nominal --document figures.md".split())
    monkeypatch.setattr(foreign, "KINDS", ("one_tap", "palm"))
    monkeypatch.setattr(foreign, "in_processes", lambda make, todo, *_: map(make, todo))
    foreign.main()
    printed = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| `")]
    assert [line.split("`")[1] for line in printed] == [f"{name}.onnx" for name in shipped()]
    page, *cards = (document.read_text().splitlines() for document in documents)
    assert [line for line in page if line.startswith("| `")] == printed
    assert [line for card in cards for line in card if line.startswith("| `")] == printed
    for lines in (page, *cards):
        assert (lines[0], lines[-1]) == ("before", "after") and "old" not in lines
