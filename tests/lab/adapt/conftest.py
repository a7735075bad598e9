"""A small simulated world in place of the thousands of takes that `adapt` cuts, and a trained model to start from."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch

from gestured.lab import export
from gestured.lab.adapt import command
from gestured.lab.adapt.learning import Simulated
from gestured.lab.adapt.weights import untrained
from gestured.lab.dataset import from_take
from gestured.lab.export import Facts, export_net
from gestured.lab.fit import CLASSES
from gestured.lab.own import learn as own
from gestured.lab.samples import WINDOW, Samples, collect
from gestured.model.context import NAMES
from gestured.simulator import GESTURES, wide
from tests.lab.conftest import Run
from tests.lab.test_own import drawn


def some(seed: int, count: int) -> Samples:
    return collect(sample for index in range(count) for sample in from_take(wide(seed, index)))


@pytest.fixture(scope="session")
def small_world() -> Simulated:
    return Simulated(some(31, 60), some(32, 60), some(34, 20), some(33, 60), np.zeros(0, np.int64))


@pytest.fixture(scope="session")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of this version that has learned nothing yet."""
    torch.manual_seed(5)
    path = tmp_path_factory.mktemp("base") / "base.onnx"
    calibration = {"temperature": [2.0, 2.0], "unknown_weight": [0.0] * 6, "unknown_bias": 0.0, "threshold": 0.5}
    origin = {"file": "old.npz", "sha256": "0" * 64, "subjects": ["1"], "consents": {}}
    facts = Facts(
        "cnn_lstm", "7", GESTURES, WINDOW, calibration, "0" * 64, {}, classes=CLASSES, context=NAMES,
        learned_from=[origin],
    )  # fmt: skip
    export_net(untrained("cnn_lstm"), path, facts)
    return path


@pytest.fixture
def little(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is simulated is made once for all tests, and little."""
    monkeypatch.setattr(command, "simulate", lambda *_, **__: request.getfixturevalue("small_world"))
    monkeypatch.setattr(own, "played", lambda *_, **__: drawn())
    monkeypatch.setattr(own, "FOLDS", 2)
    monkeypatch.setattr(export, "CHECKED_LENGTHS", (1, 15))


@pytest.fixture
def run(little: None, base: Path, run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Run:
    """Run `adapt` in a folder of its own; gives the exit status, and what it printed."""
    monkeypatch.chdir(tmp_path)
    return partial(run, "adapt", "--base", base)
