"""Zones: parts of a sensor by name, the gestures that may begin in them, and what of them cannot be."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.core.classifier import Scores
from gestured.core.events import Gesture, Place, Unknown
from gestured.core.scene import Setup
from gestured.core.where import zone_at, zones_of
from tests.core.test_sensor import SWIPED, Fake, answers, recognizer, run, says

share = st.floats(0, 1)


@given(share, share)
def test_zones_that_cover_a_sensor_hold_each_place_once(x: float, y: float) -> None:
    edges = [(0.0, 0.0, 0.3, 0.5), (0.3, 0, 1, 0.5), (0, 0.5, 0.3, 1), (0.3, 0.5, 1, 1)]
    zones = zones_of({f"part{k}": at for k, at in enumerate(edges)})
    assert [zone.holds(Place(x, y)) for zone in zones.values()].count(True) == 1
    assert zone_at(zones, Place(x, y)) == f"part{2 * (y >= 0.5) + (x >= 0.3)}"


def test_outside_of_every_zone_there_is_none() -> None:
    zones = zones_of({"volume": (0.0, 0.5, 0.5, 1.0)})
    assert zone_at(zones, Place(0.5, 0.7)) is zone_at(zones, Place(0.2, 0.49)) is zone_at({}, Place(0.5, 0.5)) is None


@pytest.mark.parametrize(
    ("told", "says"),
    [
        ({"volume": [0, 0.5, 1, 1], "lamp": [0.2, 0, 0.8, 0.6]}, r"zones.volume .* zones.lamp .* overlap"),
        ({"volume": [0, 0, 1, 1], "lamp": [0.4, 0.4, 0.6, 0.6]}, r"zones.volume .* zones.lamp .* overlap"),
        ({"volume": [0, 0.5, 1.2, 1]}, r"zones.volume: at \[0, 0.5, 1.2, 1\]: expected \[left, bottom"),
        ({"volume": [0.6, 0, 0.6, 1]}, r"zones.volume: at .* left < right"),
        ({"volume": [0, 0, math.nan, 1]}, "zones.volume: at"),
        ({"volume": [0, 0, 1]}, "zones.volume: at"),
        ({"volume": "left"}, "zones.volume: at 'left'"),
        ({"volume": {"gestures": ["left"]}}, "zones.volume: at None"),
        ({"volume": {"at": [0, 0, 1, 1], "gesture": []}}, "zones.volume: expected a name"),
        ({"volume": {"at": [0, 0, 1, 1], "gestures": "left"}}, "zones.volume: gestures 'left': expected a list"),
        ({"the volume": [0, 0, 1, 1]}, "zones.the volume: expected a name"),
        (
            {f"z{k}": [k / 99, 0, (k + 1) / 99, 1] for k in range(99)},
            "zones: expected at most 64 of a sensor, found 99",
        ),
    ],
)
def test_what_can_be_no_zone_is_named(told: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        zones_of(told)


def answer(zones: dict[str, Any], scores: Scores, **more: Any) -> Gesture | Unknown:
    """What becomes of a swipe from column 1 to 7 in row 4, so from the left half, half-way up."""
    subject = recognizer(Fake([scores]), sensors={"armrest": Setup(zones=zones_of(zones))}, **more)
    (one,) = answers(run(subject, SWIPED))
    assert isinstance(one, Gesture | Unknown)
    return one


def test_in_a_zone_of_silence_nothing_begins_whatever_the_threshold() -> None:
    found = answer({"here": {"at": (0, 0, 0.5, 1), "gestures": []}}, says(0.0, 1.0, 0.0), thresholds={"left": 0.0})
    assert isinstance(found, Unknown) and found.confidence == 0.0


@pytest.mark.parametrize(
    ("gestures", "name", "confidence"),
    [
        (["left"], "left", 0.6),
        (["right", "double_tap"], None, 0.3),  # what else it may be is not sure enough
        (["knock"], None, 0.0),  # a gesture of the user's own alone
        (None, "left", 0.6),
    ],
)
def test_in_a_zone_only_its_gestures_begin(gestures: list[str] | None, name: str | None, confidence: float) -> None:
    found = answer({"here": {"at": (0, 0, 0.5, 1), "gestures": gestures}}, says(0.1, 0.6, 0.3))
    assert (found.gesture if isinstance(found, Gesture) else None) == name
    assert found.confidence == pytest.approx(confidence) and list(found.scores) == ["double_tap", "left", "right"]
    elsewhere = answer({"there": {"at": (0.5, 0, 1, 1), "gestures": gestures}}, says(0.1, 0.6, 0.3))
    assert isinstance(elsewhere, Gesture) and elsewhere.gesture == "left"
