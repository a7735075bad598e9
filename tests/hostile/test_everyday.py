"""Twelve fixed hours of everyday contact: a model or a front end that says more nonsense, or hears less, fails."""

import pytest

from gestured.lab.dataset import in_processes
from gestured.lab.everyday import FIRST
from gestured.lab.everyday.command import at
from gestured.lab.everyday.hours import Heard, hear, judged, points_of
from gestured.lab.everyday.stretches import lived
from gestured.model.shipped import shipped

HOURS = 12
MODEL = "cnn_lstm"
MOST_FALSE = 4.5  # an hour, at `normal`
LEAST_RIGHT = 0.81
MOST_PROVISIONAL = 5.0  # false ones an hour
MOST_DEAF_MIN = 2.0  # an hour


def _heard(seed: int) -> Heard:
    return hear(lived(seed), at(MODEL, "normal"), "normal")


@pytest.mark.hostile
@pytest.mark.timeout(1200)
@pytest.mark.skipif(not shipped()[MODEL].exists(), reason="the model is not here")
def test_the_shipped_model_keeps_its_silence_in_twelve_hours() -> None:
    (model, *_) = at(MODEL, "normal")
    heard = list(in_processes(_heard, range(FIRST, FIRST + HOURS), 2, "hours"))
    found = judged(heard, MODEL, points_of(model)["normal"]).figures()
    print(found)
    assert found["false_per_hour"] <= MOST_FALSE and found["provisional_false_per_hour"] <= MOST_PROVISIONAL
    assert found["right"] >= LEAST_RIGHT
    assert sum(found["deaf_minutes_per_hour"].values()) <= MOST_DEAF_MIN
