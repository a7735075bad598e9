"""Own gestures: what is learned of people who repeat themselves, on embeddings and hands that are known."""

from pathlib import Path

import numpy as np
import pytest

from experiments.own import figures
from gestured.core.errors import ModelError
from gestured.core.own import EXAMPLES
from gestured.lab.own import learn as own
from gestured.lab.own.learn import Seen, learn, played_through, teach
from gestured.lab.own.play import LEARNED, PLAN, REPETITIONS, repeated, sign
from gestured.lab.samples import Sample, Samples, collect
from gestured.model.context import CALM
from gestured.model.model import Model
from gestured.model.prototypes import Prototype
from gestured.simulator import GESTURES, Participant, generator
from tests.daemon import tiny_model

INNER = 6


def people_who_repeat_themselves(seed: int = 0, people: int = 8) -> Seen:
    """Each person's plans lie anywhere; he repeats them with a spread of 1 in some directions, of 4 in others."""
    rng = np.random.default_rng(seed)
    spread = np.array([1.0, 1.0, 1.0, 1.0, 4.0, 4.0])
    rows = []
    for person in range(people):
        for kind in (*LEARNED, "check_mark", "corner"):
            at = rng.normal(0, 12, INNER)
            rows += [(at + spread * rng.normal(size=INNER), PLAN, kind, person) for _ in range(REPETITIONS)]
        for k, kind in enumerate(GESTURES):
            at = 40 * np.eye(INNER)[k % INNER] * (1 if k < INNER else -1)
            rows += [(at + spread * rng.normal(size=INNER), kind, kind, person) for _ in range(4)]
    x, labels, kinds, persons = zip(*rows, strict=True)
    known = np.isin(labels, GESTURES)
    best = np.array([GESTURES.index(label) if label in GESTURES else 0 for label in labels])
    return Seen(np.stack(x), best, known, np.array(labels), np.array(kinds), np.array(persons), GESTURES)


def test_what_is_learned_keeps_its_promise_for_people_it_was_not_learned_from() -> None:
    space = learn(people_who_repeat_themselves())
    found = figures(space, played_through(people_who_repeat_themselves(1), space))
    assert [one.examples for one in found] == list(range(1, EXAMPLES + 1))
    for one in found:
        assert one.accepted <= 0.03 and one.taken <= 0.01
    assert found[0].recall > 0.8 and found[-1].recall > 0.95
    assert found[-1].recall >= found[0].recall


def test_directions_in_which_one_person_spreads_count_less() -> None:
    space = learn(people_who_repeat_themselves())
    here = np.zeros((1, INNER))
    prototype = Prototype.of(space, space.place(here))
    steady, loose = (prototype.nearness(space.place(5.0 * np.eye(INNER)[k])) for k in (0, 4))
    assert loose > steady


def test_a_repetition_is_the_same_again_but_for_the_hand() -> None:
    person, extent = Participant(3), (72.0, 60.0)
    plan = sign("letter_m", person, generator(1), extent=extent)
    first, again, other = (repeated(plan, generator(seed), extent) for seed in (2, 2, 3))
    assert np.array_equal(first.contacts[0].x, again.contacts[0].x)
    assert not np.array_equal(first.contacts[0].x, other.contacts[0].x)
    for one in (first, other):
        assert len(one.contacts) == len(plan.contacts)
        assert 0 <= one.contacts[0].x.min() and one.contacts[0].x.max() <= extent[0]
        way = [np.corrcoef(getattr(one.contacts[0], axis), getattr(plan.contacts[0], axis))[0, 1] for axis in "xy"]
        assert min(way) > 0.8


def window(rng: np.random.Generator, angle: float) -> np.ndarray:
    """A finger on its way across the middle, (9, 9, 9)."""
    row, column = np.mgrid[:9, :9]
    at = 4 + np.linspace(-3, 3, 9)[:, None] * np.array([np.sin(angle), np.cos(angle)]) + rng.normal(0, 0.2, 2)
    return np.exp(-((row - at[:, 0, None, None]) ** 2 + (column - at[:, 1, None, None]) ** 2) / 2).astype(np.float16)


def drawn() -> Samples:
    """Strokes in as many directions as there are kinds."""
    rng, rows = np.random.default_rng(1), []
    kinds = [*GESTURES, *LEARNED[:6]]
    for person in range(4):
        for k, kind in enumerate(kinds):
            label = kind if kind in GESTURES else PLAN
            rows += [Sample(window(rng, 0.4 * k), label, kind, person, 50.0, 0, 8, CALM) for _ in range(REPETITIONS)]
    return collect(rows)


def test_a_model_is_taught_and_its_file_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own, "played", lambda *_, **__: drawn())
    path = tiny_model.make(tmp_path / "tiny.onnx", own=tiny_model.own())
    before = Model(path.read_bytes(), "tiny")
    space = teach(path, tmp_path, 4, 1)
    after = Model(path.read_bytes(), "tiny")
    assert after.space is not None and before.space is not None
    assert np.allclose(after.space.directions, space.directions, atol=1e-4)
    assert after.space.thresholds != before.space.thresholds
    assert after.metadata.self_test.scores.tolist() == before.metadata.self_test.scores.tolist()


def test_a_model_without_an_embedding_is_refused(tmp_path: Path) -> None:
    path = tiny_model.make(tmp_path / "tiny.onnx")
    with pytest.raises(ModelError, match="has no output 'embedding'"):
        teach(path, tmp_path, 1, 1)
