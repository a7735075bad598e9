"""Own gestures in numbers: spaces, prototypes, examples, and what is said of each attempt."""

import base64
import dataclasses
import json
import math
import re
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gestured.core.classifier import NEAR
from gestured.core.events import Cancelled
from gestured.core.frames import Segment
from gestured.core.own import EXAMPLES, Example, from_dict, is_name, to_dict
from gestured.model.enrolment import Enrolment
from gestured.model.prototypes import Prototype, Space, clashes, nearest
from tests.small_model import WINDOW, segment

RNG = np.random.default_rng(3)


def space(inner: int = 4, outer: int = 6, margin: float = 3.0) -> Space:
    """Random directions; two built-in gestures far out."""
    built_in = np.stack([np.stack([np.full(inner, 30.0), np.full(inner, -30.0)]), np.ones((2, inner))])
    directions = np.random.default_rng(1).normal(size=(inner, outer))
    return Space(np.arange(outer, dtype=float), directions, np.full(inner, 25.0), built_in, (0.0,) * 5, 0.7, margin)


def log_density(x: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> float:
    """Of a normal distribution, by the textbook."""
    d = x - mean
    return float(-0.5 * (d @ np.linalg.solve(covariance, d) + np.linalg.slogdet(2 * np.pi * covariance)[1]))


@pytest.mark.parametrize("count", range(1, EXAMPLES + 1))
def test_nearness_is_the_likelihood_ratio_of_the_two_covariance_model(count: int) -> None:
    """Against the joint distribution of examples and segment, written out as one large Gaussian."""
    own, inner = space(), 4
    places = RNG.normal(0, 5, (count + 1, inner))
    found = float(Prototype.of(own, places[:count]).nearness(places[count]))
    between = np.diag(own.between)

    def joint(rows: np.ndarray) -> float:
        n = len(rows)
        covariance = np.kron(np.ones((n, n)), between) + np.eye(n * inner)
        return log_density(rows.ravel(), np.zeros(n * inner), covariance)

    expected = joint(places) - joint(places[:count]) - joint(places[count:])
    assert found == pytest.approx(expected, abs=1e-8)


def test_more_examples_are_believed_more_and_order_does_not_matter() -> None:
    own = space()
    places = RNG.normal(8, 1, (5, 4))
    assert (Prototype.of(own, places).variance < Prototype.of(own, places[:1]).variance).all()
    assert np.allclose(Prototype.of(own, places).mean, Prototype.of(own, places[::-1]).mean)


def test_the_confidence_is_near_at_the_threshold_and_rises_with_nearness() -> None:
    own = space()
    prototype = Prototype.of(own, np.array([[3.0, 0.0, 0.0, 0.0]]))
    along = [np.array([3.0 + d, 0, 0, 0]) for d in np.linspace(0, 20, 50)]
    confidences = [prototype.confidence(place) for place in along]
    assert confidences == sorted(confidences, reverse=True)
    assert all((c >= NEAR) == (prototype.nearness(p) >= 0) for c, p in zip(confidences, along, strict=True))


def test_the_nearest_wins_and_lies_nearer_than_the_models_only_far_from_them() -> None:
    own = space()
    prototypes = {
        "near": Prototype.of(own, np.array([[5.0, 0, 0, 0]])),
        "there": Prototype.of(own, np.full((1, 4), 30.0)),
    }
    match = nearest(own, prototypes, np.array([5.5, 0, 0, 0]))
    assert match is not None
    assert (match.name, match.nearer) == ("near", True)
    built_in = nearest(own, prototypes, np.full(4, 30.0))
    assert built_in is not None
    assert (built_in.name, built_in.nearer) == ("there", False)
    assert nearest(own, {}, np.zeros(4)) is None
    assert own.claimed(np.full(4, 30.0))
    assert not own.claimed(np.array([5.0, 0, 0, 0]))


def test_gestures_of_which_one_may_be_taken_for_the_other_are_named() -> None:
    places = {"a": np.array([[8.0, 0, 0, 0]]), "b": np.array([[8.3, 0, 0, 0]]), "c": np.array([[-20.0, 9, 0, 0]])}
    prototypes = {name: Prototype.of(space(), found) for name, found in places.items()}
    assert set(clashes(prototypes, places)) == {("a", "b"), ("b", "a")}


def test_a_space_outlives_its_json_and_a_wrong_one_is_refused() -> None:
    own = space()
    told = json.loads(own.to_json())
    again = Space.from_json(told, 2)
    x = RNG.normal(size=6)
    assert np.allclose(again.place(x), own.place(x), atol=1e-4)
    assert again.thresholds == own.thresholds
    for key, value in (
        ("thresholds", [0.0]), ("slope", 0), ("slope", float("nan")), ("margin", "x"), ("between", "!"), ("mean", ""),
        ("between", told["mean"]), ("built_in", told["mean"]), ("directions", None),
    ):  # fmt: skip
        with pytest.raises(ValueError, match="expected"):
            Space.from_json(told | {key: value}, 2)
    with pytest.raises(ValueError, match="expected"):
        Space.from_json(told, 3)


def test_an_example_gives_the_window_that_the_segment_gave() -> None:
    """So that the same model sees the same in it, and another one what it would have seen."""
    performed = segment()
    example = Example.of(performed, WINDOW)
    assert example is not None
    again = WINDOW.apply(example.segment())
    assert again.shape == WINDOW.apply(performed).shape
    assert np.abs(again - WINDOW.apply(performed)).max() < 1e-3
    wider = dataclasses.replace(WINDOW, rows=6, columns=6, rate_hz=30.0)
    assert np.abs(wider.apply(example.segment()) - wider.apply(performed)).mean() < 0.02


@pytest.mark.parametrize("rate_hz", [13.5, 20, 25, 27])
def test_an_example_at_a_rate_near_the_models_is_whole(rate_hz: float) -> None:
    """Its window has the sensor's own frames, which are not so far apart as the model's."""
    n = round(rate_hz)
    frames = np.zeros((n + 6, 9, 9), np.float32)
    frames[3 : n + 3] = np.linspace(0.1, 1, n)[:, None, None]
    performed = Segment(frames, np.arange(n + 6) / rate_hz, 3, n + 2, 0.001)
    example = Example.of(performed, WINDOW)
    assert example is not None
    window, again = WINDOW.apply(performed), WINDOW.apply(example.segment())
    assert again.shape == window.shape
    assert np.abs(again - window).max() < 1e-3
    assert example.segment().offset - example.segment().onset == pytest.approx(performed.offset - performed.onset)


def test_what_is_written_down_is_read_again() -> None:
    example = Example.of(segment(), WINDOW)
    assert example is not None
    told = json.loads(json.dumps(to_dict({"wave": (example, example)})))
    (again, _) = from_dict(told)["wave"]
    assert np.array_equal(again.frames, example.frames)
    assert (again.first, again.last, again.rate_hz) == (example.first, example.last, example.rate_hz)


@given(
    st.floats(0.05, 1200) | st.floats(),
    st.integers(-1, 300),
    st.sampled_from([(9, 9), (2, 64), (1, 9), (65, 2), (200, 81)]),
)
@settings(deadline=None)
def test_whatever_numbers_are_read_the_work_is_bounded(rate_hz: float, count: int, sides: tuple[int, int]) -> None:
    """An example that is read gives any model as much to look at as a contact of ten seconds, or less."""
    frames = base64.b64encode(bytes(2 * max(count, 0) * sides[0] * sides[1])).decode()
    told = {"shape": [count, *sides], "rate_hz": rate_hz, "first": 0, "last": count - 1, "noise": 0.1, "frames": frames}
    try:
        (example,) = from_dict({"wave": [told]})["wave"]
    except ValueError as error:
        assert re.match(r"gestures\.wave\[0\]: (rate_hz|frames|rows|columns|values|last|expected)", str(error))
    else:
        assert len(WINDOW.apply(example.segment())) <= 10 * WINDOW.rate_hz


@pytest.mark.parametrize("rate_hz", [5e-324, 1e-9, 1e-4, 4.9, 1001.0, math.inf, math.nan])
def test_a_rate_that_no_sensor_has_is_named(rate_hz: float) -> None:
    told = to_dict({"wave": (Example(np.zeros((3, 9, 9), np.float16), 15.0, 0, 2, 0.0),)})
    told["wave"][0]["rate_hz"] = rate_hz
    with pytest.raises(ValueError, match=r"gestures\.wave\[0\]: rate_hz: expected 5 to 1000, found"):
        from_dict(told)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)


@given(JSON, st.sampled_from(["", "wave", "frames", "shape", "first", "rate_hz", "noise"]))
@settings(max_examples=200, deadline=None)
def test_anything_else_that_is_read_is_refused_in_one_sentence(value: object, place: str) -> None:
    example = Example.of(segment(), WINDOW)
    assert example is not None
    told = to_dict({"wave": (example,)})
    if place == "":
        told = value  # type: ignore[assignment]
    elif place == "wave":
        told["wave"] = value
    else:
        told["wave"][0][place] = value
    try:
        found = from_dict(told)
    except ValueError as error:
        assert "\n" not in str(error) and "expected" in str(error)
    else:
        assert to_dict(found) or not found


@pytest.mark.parametrize("name", ["use", "unknown", "none", "", "Wave", "1wave", "wäve", "a" * 33, "a-b", "wave\n"])
def test_names_that_cannot_be(name: str) -> None:
    assert not is_name(name)


class Anything:
    """A judge to whom everything is new."""

    def example(self, segment: Segment) -> Example | None:
        return Example.of(segment, WINDOW)

    def same_as(self, example: Example) -> str | None:
        return None

    def unlike(self, example: Example, kept: Sequence[Example]) -> str | None:
        return None


def test_what_no_hand_can_perform_at_will_has_its_reason_too() -> None:
    """What else may be wrong with one, tests/daemon/test_own.py says."""
    enrolment = Enrolment("wave", "armrest", 2, Anything())
    assert "silent" in enrolment.see(Cancelled("armrest", 1, "silence"))["reason"]
    whole = segment(9)
    times = whole.times.copy()
    times[5:] += 0.4
    assert "frames were lost" in enrolment.see(dataclasses.replace(whole, times=times))["reason"]
    assert "too long" in enrolment.see(segment(300))["reason"]
