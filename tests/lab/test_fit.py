"""Training goes on where it stopped, comes out the same, and tells people apart."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from gestured.lab import dataset, fit, train
from gestured.lab.dataset import OTHER_TRIALS, STREAMS, TRIALS
from gestured.lab.fit import (
    CLASSES,
    REAL_KINDS,
    FitConfig,
    balanced,
    build,
    finetune,
    kept_nets,
    logits,
    padded,
    pretrain,
    targets,
)
from gestured.lab.progress import progress as shown
from gestured.lab.samples import Samples, collect
from gestured.simulator import GESTURES

SMALL = FitConfig(epochs=2, batch=16, real_epochs=1, real_samples=32)


@pytest.fixture(scope="module")
def samples() -> Samples:
    return collect(s for i in range(60) for s in STREAMS["wide"](11, i))


def weights(nets: nn.ModuleDict) -> dict[str, np.ndarray]:
    return {name: value.numpy().copy() for name, value in nets.state_dict().items()}


def alike(a: nn.ModuleDict, b: nn.ModuleDict) -> None:
    one, two = weights(a), weights(b)
    assert one.keys() == two.keys()
    for name in one:
        np.testing.assert_allclose(one[name], two[name], atol=1e-6, rtol=0, err_msg=name)


def interrupted(samples: Samples, checkpoint: Path) -> nn.ModuleDict:
    """A run that is ended while the second epoch is going on, and another one that goes on."""
    real, seen = shown, []

    def progress(items: Any, total: int, title: str) -> Any:
        seen.append(title)
        for n, item in enumerate(items):
            if len(seen) == 2 and n == 1:
                raise KeyboardInterrupt
            yield item

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit, "progress", progress)
        with pytest.raises(KeyboardInterrupt):
            pretrain(samples, SMALL, checkpoint)
        seen.clear()
        patch.setattr(fit, "progress", lambda items, total, title: seen.append(title) or real(items, total, title))
        torch.manual_seed(12345)  # another process
        nets = pretrain(samples, SMALL, checkpoint)
    assert len(seen) == SMALL.epochs - 1  # what was finished is not done again
    return nets


@pytest.fixture(scope="module")
def whole(samples: Samples, tmp_path_factory: pytest.TempPathFactory) -> tuple[nn.ModuleDict, list[float]]:
    """The networks of a run that nothing disturbed, and its loss by epoch."""
    losses: list[float] = []
    real = fit.one_epoch
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit, "one_epoch", lambda *a: losses.append(real(*a)) or losses[-1])
        return pretrain(samples, SMALL, tmp_path_factory.mktemp("whole") / "checkpoint.npz"), losses


def test_a_killed_run_goes_on_as_if_nothing_had_been(
    samples: Samples, whole: tuple[nn.ModuleDict, list[float]], tmp_path: Path
) -> None:
    """Training is the same every time, whatever was drawn before it, and with the same dropout."""
    alike(interrupted(samples, tmp_path / "parts.npz"), whole[0])


def test_training_changes_every_net_and_lowers_the_loss(whole: tuple[nn.ModuleDict, list[float]]) -> None:
    torch.manual_seed(SMALL.seed)
    before, after, losses = weights(build()), weights(whole[0]), whole[1]
    assert losses[-1] < losses[0]
    for name, value in before.items():
        assert not np.array_equal(value, after[name]), name


def test_weights_survive_the_file(samples: Samples, tmp_path: Path) -> None:
    torch.manual_seed(3)
    nets, path = build(), tmp_path / "new" / "nets.npz"
    alike(nets, kept_nets(path, lambda: nets))
    alike(nets, kept_nets(path, lambda: pytest.fail("made again")))
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["nets.npz"]


def test_every_sample_is_learned_from_once_an_epoch(samples: Samples) -> None:
    chosen = np.flatnonzero(targets(samples) >= 0)
    for seed in range(3):
        plan = list(fit.similar(samples, chosen, SMALL.batch, np.random.default_rng(seed)))
        assert sorted(np.concatenate(plan).tolist()) == chosen.tolist()
        assert max(map(len, plan)) <= SMALL.batch


def test_windows_are_padded_with_nothing(samples: Samples) -> None:
    index = np.arange(len(samples))
    x = padded(samples, index, 80).numpy()
    for i in index:
        length = min(len(samples.window(i)), 80)
        assert np.array_equal(x[i, :length], samples.window(i)[:length])
        assert not x[i, length:].any()
    assert padded(samples, index, 5).shape[1] == 5


def test_logits_come_in_the_order_of_the_samples(samples: Samples) -> None:
    torch.manual_seed(3)
    nets = build()
    together = logits(nets, samples)
    for i in (0, 7, len(samples) - 1):
        for name, found in logits(nets, samples.take(np.array([i]))).items():
            torch.testing.assert_close(found[0], together[name][i], atol=1e-5, rtol=1e-5)


def test_classes_are_the_gestures_then_the_kinds_of_non_gestures(samples: Samples) -> None:
    assert tuple(CLASSES[: len(GESTURES)]) == GESTURES
    assert set(REAL_KINDS.values()) <= set(CLASSES[len(GESTURES) :])
    found = targets(samples)
    for label, kind, k in zip(samples.labels, samples.kinds, found, strict=True):
        assert CLASSES[k] == (kind if label == "none" else label)


def test_rare_classes_are_drawn_more_often_than_they_come() -> None:
    labels = np.repeat(np.array([0, 1], np.int64), [900, 100])
    drawn = labels[balanced(labels, np.arange(1000), 20_000, np.random.default_rng(0))]
    assert (drawn == 1).mean() == pytest.approx(0.25, abs=0.02)  # square roots: 3 to 1


# --- who is who ---


@pytest.fixture(scope="module")
def everyone() -> dict[str, Samples]:
    """One take of each participant of each stream, and some of the wide one by seed."""
    people = {person: k for k, (person, *_) in enumerate(OTHER_TRIALS)}
    trials = {trial.participant: trial.index for trial in TRIALS}
    patch = pytest.MonkeyPatch()
    patch.setattr(dataset, "DAY_S", 90.0)
    made = {f"wide{seed}": collect(s for i in range(10) for s in STREAMS["wide"](seed, i)) for seed in (1, 2, 3)}
    for number, (stream, seed) in enumerate(
        (("days", 1), ("days", 2), ("nominal_days", 3), ("days_by_chance", 1), ("days_by_chance", 2))
    ):
        made[f"{stream}{seed}"] = collect(s for s in STREAMS[stream](seed, 40 + number))
    patch.undo()
    made["cohort"] = collect(s for i in trials.values() for s in STREAMS["cohort"](0, i))
    made["others"] = collect(s for i in people.values() for s in STREAMS["others"](0, i))
    return made


@pytest.fixture(scope="module")
def data(everyone: dict[str, Samples], tmp_path_factory: pytest.TempPathFactory) -> train.TrainingData:
    def simulated(cache: Path, stream: str, seed: int, count: int, jobs: int = 2) -> Samples:
        return everyone[stream if stream in ("cohort", "others") else f"{stream}{seed}"]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train, "simulated", simulated)
        plan = train.TrainingPlan(wide_check=10)
        return train.load_data(plan, tmp_path_factory.mktemp("cache"), None, 1)


def test_nobody_is_on_two_sides_of_the_split(data: train.TrainingData, everyone: dict[str, Samples]) -> None:
    assert data.performed["nominal"] == 6 * 90
    days = {"lived": data.lived, "spoken": data.spoken}
    parts = {"teach": data.teach, "calibrate": data.calibrate, **days, **data.tests}
    people = {name: set(samples.people.tolist()) for name, samples in parts.items()}
    for a in people:
        assert people[a]
        for b in people:
            assert a == b or not people[a] & people[b], (a, b)
    assert sum(map(len, parts.values())) == sum(map(len, everyone.values()))  # and nobody is forgotten
    cohort = {name: {p for p in found if p < 1000} for name, found in people.items()}
    assert set().union(*cohort.values()) >= set(range(30))
    assert cohort["wide"] == set()


def named_people(samples: Samples, people: np.ndarray) -> Samples:
    return replace(samples, people=people)


def test_no_real_subject_is_judged_by_a_net_that_has_seen_it(
    data: train.TrainingData, tmp_path: Path, samples: Samples, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = named_people(samples, np.arange(len(samples)) % 7)
    data = replace(data, real=real)
    taught: list[set[int]] = []
    judged: list[set[int]] = []

    def tune(start: nn.ModuleDict, simulated: Samples, shown: Samples, *_: object) -> nn.ModuleDict:
        taught.append(set(shown.people.tolist()))
        return start

    def judge(nets: nn.ModuleDict, shown: Samples) -> dict[str, Any]:
        judged.append(set(shown.people.tolist()))
        return {name: torch.full((len(shown), len(CLASSES)), float(len(judged))) for name in nets}

    monkeypatch.setattr(train, "pretrain", lambda *_: build())
    monkeypatch.setattr(train, "finetune", tune)
    monkeypatch.setattr(train, "logits", judge)
    trained = train.learn(train.TrainingPlan(), data, tmp_path)
    assert len(judged) == train.FOLDS
    for seen, asked in zip(taught, judged, strict=False):
        assert asked
        assert not seen & asked
    assert sorted(p for asked in judged for p in asked) == list(range(7))  # each once
    assert taught[-1] == set(range(7))  # the shipped net has seen all
    assert trained.held_out is not None
    for i, person in enumerate(real.people):
        (fold,) = [k for k, asked in enumerate(judged, 1) if person in asked]
        assert float(trained.held_out["lstm"][i, 0]) == fold

    monkeypatch.setattr(train, "pretrain", lambda *_: pytest.fail("what is done is not done again"))
    monkeypatch.setattr(train, "finetune", lambda *_: pytest.fail("what is done is not done again"))
    train.learn(train.TrainingPlan(), data, tmp_path)

    # A candidate is another training: nothing of the shipped networks is taken for it.
    monkeypatch.setattr(train, "pretrain", lambda *given: build(given[-1]))
    monkeypatch.setattr(train, "finetune", tune)
    candidate = train.learn(train.TrainingPlan(), data, tmp_path, ["lstm"])
    assert set(candidate.nets) == {"lstm"} == set(candidate.held_out or ())


def test_stage_two_starts_from_stage_one_and_leaves_it_alone(samples: Samples) -> None:
    torch.manual_seed(4)
    start = build()
    kept = weights(start)
    tuned = weights(finetune(start, samples, samples, SMALL, "tuning"))
    for name, value in weights(start).items():
        assert np.array_equal(value, kept[name])
    moved = max(float(np.abs(tuned[n] - kept[n]).max()) for n in kept)
    assert 0 < moved < 0.5
