"""What no sensor should send: nothing that is not finite comes out, and a swipe stays a swipe."""

from itertools import product

import numpy as np
import pytest

from gestured.core.classifier import Scores
from gestured.core.events import Cancelled, Onset, Release
from gestured.core.frames import Segment
from gestured.core.window import Window
from gestured.lab.samples import WINDOW
from gestured.lab.stability.decisions import segment_cases
from gestured.lab.stability.extremes import Case, Series, fault, streams, swipes, swipes_found, whole_path_table
from gestured.model.features import touch_pattern
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER


@pytest.fixture(scope="module")
def models() -> list[Model]:
    return [open_model(name) for name in LADDER]


WINDOWS = (
    WINDOW,
    Window(9, 9, 15.0, 3, 1 / 15, 1 / 15, 4.0),
    Window(5, 7, 60.0, 1, 1 / 15, 1 / 15, 4.0),
    Window(27, 15, 5.0, 1, 1 / 15, 1 / 15, 0.0),
)


@pytest.mark.filterwarnings("error")
def test_windows_and_features_bear_every_segment() -> None:
    segments = list(segment_cases(quick=True))
    assert len(segments) > 150
    for window, segment in product(WINDOWS, segments):
        made = window.apply(segment)
        assert len(made) and made.min() >= 0.0 and made.max() <= 1.0 + 1e-6
        assert np.isfinite(touch_pattern(made, window.rate_hz)).all()


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
