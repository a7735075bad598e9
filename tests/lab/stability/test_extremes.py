"""What no sensor should send: nothing that is not finite comes out, and a swipe stays a swipe."""

import numpy as np
import pytest

from gestured.core.classifier import Scores
from gestured.core.events import Cancelled, Onset, Release
from gestured.core.frames import Segment
from gestured.lab.stability.extremes import Case, Series, fault, streams, swipes, swipes_found, whole_path_table
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER


@pytest.fixture(scope="module")
def models() -> list[Model]:
    return [open_model(name) for name in LADDER]


def test_the_whole_path_bears_every_stream(models: list[Model]) -> None:
    table = whole_path_table(models[0], quick=True)
    assert len(table.rows) > 15
    assert [row for row in table.rows if row[3]] == []
    for family, _, share, *_ in table.rows:
        found, _, asked = str(share).partition("/")
        assert found == asked or share == "-", family


class Careless:
    """Says something that is no probability."""

    gestures = ("swipe_right",)

    def classify(self, segment: Segment) -> Scores:
        with np.errstate(all="warn"):
            return Scores(np.array([np.float32(1e30) * np.float32(1e30)]), 0.0, "careless")


def test_the_judge_sees_what_is_wrong(models: list[Model]) -> None:
    """Or the tables above would say nothing."""
    stream, when = swipes(1)
    assert swipes_found(Case("", stream, when, alone=True), models[0]) == (1, "")
    assert swipes_found(Case("", stream, alone=True), models[0])[1] == "answered swipe_right"
    assert swipes_found(Case("", stream, (0.2,)), models[0]) == (0, "")
    backwards = Series(stream.times[::-1], stream.frames)
    assert swipes_found(Case("", backwards), models[0])[1].startswith("ValueError")
    assert "overflow" in swipes_found(Case("", stream), Careless())[1]
    assert fault([Onset("s", 1, 0.0), Release("s", 1, 1.0)])
    assert fault([Onset("s", 1, 0.0), Cancelled("s", 2, "held")])
    assert next(streams(quick=True)).swipes
