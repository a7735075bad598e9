"""The verifier and the operating points: what tells a meant gesture from everyday life, and at what cost."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs the lab's packages")

import torch

from gestured.core.points import STRICTNESS
from gestured.lab.everyday.hours import LEVELS
from gestured.lab.fit import build
from gestured.lab.nets import Decision
from gestured.lab.points import alike, operating_points
from gestured.lab.samples import EVERYDAY, LIKE_A_TAP, Samples
from gestured.lab.train import Trained
from gestured.lab.verifier import Evidence, fit_verifier, taught, with_past_of
from gestured.model.context import NAMES, PAST
from gestured.model.points import operating_points as parsed
from gestured.simulator import GESTURES, NONE
from tests.lab.study.material_made import samples

K = len(GESTURES) + 3


def evidence(count: int, covered: np.ndarray) -> Evidence:
    """Gestures that the networks take for such, on a sensor that is covered or not."""
    logits = torch.zeros(count, K)
    logits[:, 0] = 4.0
    context = torch.zeros(count, len(NAMES))
    context[:, NAMES.index("covered")] = torch.from_numpy(covered.astype(np.float32))
    return Evidence(logits, logits.clone(), torch.zeros(count, 5), context)


def test_what_surrounds_a_contact_can_tell_what_was_meant() -> None:
    """The networks see the same in both; only everyday life lies on a covered sensor."""
    rng = np.random.default_rng(0)
    covered = rng.random(2000) < 0.5
    decision = Decision(len(GESTURES))
    verifier = fit_verifier(decision, [(evidence(2000, covered), covered.astype(np.int64))], seed=1)
    _, unknown = evidence(2, np.array([False, True])).answers(decision, verifier)
    assert unknown[0] < 0.1 and unknown[1] > 0.9


def test_evidence_that_is_kept_has_the_context_of_the_samples_that_are_asked_about() -> None:
    one = samples(1)
    trained = Trained(build(("lstm", "trajectory")), None)
    for around in (one.context, one.context + 1):
        found = trained.evidence("lstm", replace(one, context=around))
        np.testing.assert_array_equal(found.context.numpy(), around)


def test_a_take_has_the_past_of_everyday_life_and_measures_of_its_own() -> None:
    takes, lived = samples(1), samples(2)
    lived.context[:, :PAST] = np.arange(len(lived))[:, None]
    mixed = with_past_of(takes, lived, 3)
    assert (mixed[:, PAST:] == takes.context[:, PAST:]).all()
    assert set(mixed[:, 0]) <= set(lived.context[:, 0]) and len(set(mixed[:, 0])) > 1


def spoken(confidence: dict[str, list[tuple[str, float]]]) -> tuple[tuple[np.ndarray, np.ndarray], Samples]:
    """Answers to segments (label or EVERYDAY, confidence) by the gesture that each is taken for, and the segments."""
    made, scores, unknown = [], [], []
    for name, segments in confidence.items():
        for label, sure in segments:
            made.append((NONE, EVERYDAY) if label == EVERYDAY else (label, "nothing"))
            scores.append(np.eye(len(GESTURES))[GESTURES.index(name)])
            unknown.append(1 - sure)
    labels, kinds = np.array(made).T
    found = replace(samples(1).take(np.zeros(len(made), np.int64)), labels=labels, kinds=kinds)
    return (np.array(scores, np.float32), np.array(unknown, np.float32)), found


def test_points_say_less_the_stricter_they_are_and_a_file_can_hold_them() -> None:
    rng = np.random.default_rng(1)
    said = {
        name: [(name, float(s)) for s in rng.beta(6, 2, 60)] + [(EVERYDAY, float(s)) for s in rng.beta(2, 4, 60)]
        for name in GESTURES
    }
    found = operating_points(*spoken(said), performed=700, hours=10.0)
    points = [found[name] for name in STRICTNESS]
    assert [p["false_per_hour"] for p in points] == sorted((p["false_per_hour"] for p in points), reverse=True)
    assert [p["missed"] for p in points] == sorted(p["missed"] for p in points)
    assert min(p["missed"] for p in points) >= 1 - 600 / 700  # what was never cut out is missed
    parsed(found, GESTURES)
    assert [row[0] for row in found["curve"]] == LEVELS


def test_mirror_images_share_a_threshold() -> None:
    groups = {tuple(GESTURES[k] for k in group) for group in alike()}
    assert ("swipe_down", "swipe_up", "swipe_right", "swipe_left") in groups and ("one_tap",) in groups
    said = {"swipe_left": [("swipe_left", 0.9)] * 9 + [(EVERYDAY, 0.6)] * 9, "swipe_up": [("swipe_up", 0.7)] * 9}
    found = operating_points(*spoken(said), performed=18, hours=1.0)
    assert 0.6 < found["normal"]["thresholds"]["swipe_left"] == found["normal"]["thresholds"]["swipe_up"] <= 0.7


def test_taps_in_truth_teach_nothing() -> None:
    some = samples(1).take(np.array([0, 1, 2]))
    labels, kinds = np.array(["one_tap", NONE, NONE]), np.array(["one_tap", EVERYDAY, LIKE_A_TAP])
    assert taught(replace(some, labels=labels, kinds=kinds)).tolist() == [0, 1, -1]
