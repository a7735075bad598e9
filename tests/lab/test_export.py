"""Export: the file gives what the trained model gives, for every batch and length, or there is no file."""

import hashlib
import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from sklearn.ensemble import RandomForestClassifier
from torch import Tensor, nn

from gestured.core.errors import ModelError
from gestured.lab.export import Facts, export_forest, export_net, measured, write_manifest
from gestured.lab.forest import forest_outputs
from gestured.lab.recordings.origin import Origin, said
from gestured.model.features import feature_names
from gestured.model.opening import open_model
from tests.small_model import WINDOW, segment

GESTURES = ("one_tap", "swipe_up", "swipe_left")
CARD: dict[str, Any] = {
    "kind": "test_net",
    "version": "1.2.0",
    "gestures": GESTURES,
    "window": WINDOW,
    "calibration": {"temperature": 1.7},
    "training_data": hashlib.sha256(b"data").hexdigest(),
    "quantiles": {"duration_s": [0.1, 0.4, 1.2]},
}


class Net(nn.Module):
    """An LSTM on taxels, read at the last frame; the lab's own networks are exported by the tests of their commands."""

    def __init__(self) -> None:
        super().__init__()
        torch.manual_seed(0)
        self.lstm, self.head = nn.LSTM(81, 16, batch_first=True), nn.Linear(16, len(GESTURES) + 1)

    def forward(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        logits = self.head(self.lstm(frames.flatten(2))[0][:, -1])
        return torch.softmax(logits[:, :-1] / 1.7, 1), torch.sigmoid(logits[:, -1])


@pytest.fixture(scope="module")
def net(tmp_path_factory: pytest.TempPathFactory) -> tuple[Net, Path]:
    module = Net()
    path = tmp_path_factory.mktemp("net") / "test_net.onnx"
    export_net(module, path, Facts(**CARD))
    return module, path


def test_daemon_reads_back_what_was_said_of_the_model(net: tuple[Net, Path]) -> None:
    module, path = net
    model = open_model(path)
    known = model.metadata
    assert (model.name, known.kind, known.version) == ("test_net", "test_net", "1.2.0")
    assert (known.gestures, known.window, known.features) == (GESTURES, WINDOW, None)
    assert known.calibration == CARD["calibration"]
    assert known.quantiles == CARD["quantiles"]
    assert known.training_data == CARD["training_data"]
    with torch.no_grad():
        scores, unknown = module(torch.from_numpy(WINDOW.apply(segment())[np.newaxis]))
    found = model.classify(segment())
    np.testing.assert_allclose(found.values, scores[0].numpy(), atol=1e-4)
    assert found.unknown == pytest.approx(float(unknown[0]), abs=1e-4)


def test_file_names_no_place_on_this_machine(net: tuple[Net, Path]) -> None:
    data = net[1].read_bytes()
    for place in (str(Path.home()), str(net[1].parent), str(Path(__file__).parent), sys.prefix):
        assert place.encode() not in data


def test_the_same_module_is_the_same_file(net: tuple[Net, Path], tmp_path: Path) -> None:
    export_net(net[0], tmp_path / "again.onnx", Facts(**CARD))
    assert (tmp_path / "again.onnx").read_bytes() == net[1].read_bytes()


class Frozen(Net):
    """Asks for the length in Python: the answer for the example is built into the graph."""

    def forward(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        scores, unknown = super().forward(frames)
        return (scores, unknown) if int(frames.shape[1]) <= 20 else (scores, unknown * 0.5)


class Mixing(Net):
    """One gesture's answer depends on the others in its batch."""

    def forward(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        scores, unknown = super().forward(frames)
        return scores, torch.sigmoid(unknown - 10 * unknown.mean())


class Logits(Net):
    """Gives no probabilities."""

    def forward(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        scores, unknown = super().forward(frames)
        return torch.log(scores), unknown


class Embedding(Net):
    """Gives what its head sees, too."""

    def forward(self, frames: Tensor) -> tuple[Tensor, ...]:  # type: ignore[override]
        return (*super().forward(frames), frames.flatten(2).amax(1))


class MixedEmbedding(Embedding):
    """One window's embedding depends on the others in its batch."""

    def forward(self, frames: Tensor) -> tuple[Tensor, ...]:  # type: ignore[override]
        scores, unknown, embedding = super().forward(frames)
        return scores, unknown, embedding - embedding.mean(0)


def test_a_file_holds_the_embedding_and_older_ones_have_none(net: tuple[Net, Path], tmp_path: Path) -> None:
    rule = {"in_a_row": 2, "elapsed_s": [0.0, 0.3], "thresholds": [None, 0.9], "gestures": {}, "tap": None}
    more = {"classes": [*GESTURES, "palm"], "provisional": rule}
    export_net(Embedding(), tmp_path / "new.onnx", Facts(**CARD, **more))
    model, old = open_model(tmp_path / "new.onnx"), open_model(net[1])
    frames = np.random.default_rng(2).random((3, 21, 9, 9), np.float32)
    np.testing.assert_allclose(model.embed(frames), frames.reshape(3, 21, -1).max(axis=1), atol=1e-5)
    for one, other in zip(model.run(frames), old.run(frames), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)
    assert (model.embeds, old.embeds) == (True, False)
    said = model.properties
    assert {key: json.loads(said[key]) for key in more} == more
    with pytest.raises(ValueError, match="cannot run"):
        old.embed(frames)


@pytest.mark.parametrize("module", [Frozen(), Mixing(), Logits(), MixedEmbedding()], ids=lambda m: type(m).__name__)
def test_net_that_the_file_cannot_stand_for_is_not_written(module: Net, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"wrong\.onnx: not written"):
        export_net(module, tmp_path / "wrong.onnx", Facts(**CARD))
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(("key", "value"), [("gestures", ("one_tap", "swipe_up")), ("training_data", "unknown")])
def test_metadata_that_would_be_refused_is_not_written(key: str, value: Any, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="not written"):
        export_net(Net(), tmp_path / "wrong.onnx", Facts(**{**CARD, key: value}))
    assert os.listdir(tmp_path) == []


# --- the forest ---

FEATURES = feature_names(9, 9)


def forest(classes: int, trees: int = 12, depth: int | None = 5, seed: int = 0) -> RandomForestClassifier:
    random = np.random.default_rng(seed)
    labels = np.arange(400) % classes
    values = random.normal(size=(400, len(FEATURES))) + 0.4 * labels[:, None] * (np.arange(len(FEATURES)) % 3)
    return RandomForestClassifier(trees, max_depth=depth, random_state=seed).fit(values.astype(np.float32), labels)


@pytest.mark.parametrize(("classes", "trees", "depth"), [(3, 1, 1), (3, 12, 5), (5, 12, 5), (4, 3, None), (6, 40, 9)])
def test_forest_equals_scikit_learn(classes: int, trees: int, depth: int | None, tmp_path: Path) -> None:
    trained = forest(classes, trees, depth)
    export_forest(trained, tmp_path / "rf.onnx", Facts(**CARD), FEATURES)
    model = open_model(tmp_path / "rf.onnx")
    values = np.random.default_rng(5).normal(size=(300, len(FEATURES))).astype(np.float32) * 3
    scores, unknown = model.run(values)
    expected = forest_outputs(trained.predict_proba(values), len(GESTURES), CARD["calibration"])
    np.testing.assert_allclose(scores, expected[0], atol=1e-4)
    np.testing.assert_allclose(unknown, expected[1], atol=1e-4)
    assert model.metadata.features == FEATURES
    assert model.classify(segment()).values.sum() == pytest.approx(1.0, abs=1e-5)


def test_values_on_a_threshold_go_where_scikit_learn_sends_them(tmp_path: Path) -> None:
    trained = forest(5)
    export_forest(trained, tmp_path / "rf.onnx", Facts(**CARD), FEATURES)
    model = open_model(tmp_path / "rf.onnx")
    thresholds = np.concatenate([tree.tree_.threshold for tree in trained.estimators_])
    for toward in (-np.inf, 0.0, np.inf):
        values = np.float32(np.random.default_rng(1).choice(thresholds, (200, len(FEATURES))))
        if toward:
            values = np.nextafter(values, np.float32(toward))
        expected = forest_outputs(trained.predict_proba(values), len(GESTURES), CARD["calibration"])
        np.testing.assert_allclose(model.run(values)[0], expected[0], atol=1e-5)


def test_uncalibrated_outputs_are_the_forests_own() -> None:
    probabilities = np.array([[0.3, 0.1, 0.2, 0.25, 0.15], [0.6, 0.4, 0.0, 0.0, 0.0], [0, 0, 0, 0, 1.0]])
    scores, unknown = forest_outputs(probabilities, 3, {})
    np.testing.assert_allclose(scores[0], [0.5, 1 / 6, 1 / 3], atol=1e-6)
    np.testing.assert_allclose(unknown, [0.4, 0.0, 1.0], atol=2e-3)
    np.testing.assert_allclose(scores.sum(axis=1), 1.0, atol=1e-6)


def test_forest_that_does_not_fit_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "rf.onnx"
    with pytest.raises(ModelError, match="features"):
        export_forest(forest(5), path, Facts(**CARD), FEATURES[:-1])
    with pytest.raises(ModelError, match="'features'"):
        export_forest(forest(5), path, Facts(**CARD), FEATURES[::-1])
    with pytest.raises(ModelError, match="classes"):
        export_forest(forest(2), path, Facts(**CARD), FEATURES)
    named = forest(5).set_params(n_estimators=1)
    named.fit(np.zeros((6, len(FEATURES))), np.array(["a", "b", "c"] * 2))
    with pytest.raises(ModelError, match="classes"):
        export_forest(named, path, Facts(**CARD), FEATURES)
    with pytest.raises(ModelError, match="temperature"):
        export_forest(forest(3), path, Facts(**{**CARD, "calibration": {"temperature": 0}}), FEATURES)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("learned", [None, [], [Origin("07.npz", "0" * 64, ["07", "A-1"])]])
def test_a_model_says_whose_recordings_it_learned_from(learned: list[Origin] | None, tmp_path: Path) -> None:
    path = tmp_path / "model.onnx"
    people = None if learned is None else [asdict(one) for one in learned]
    export_forest(forest(5), path, Facts(**CARD, learned_from=people), FEATURES)
    assert said(path) == learned
    assert open_model(path).gestures == GESTURES


# --- the manifest ---


def test_manifest_knows_every_file(net: tuple[Net, Path], tmp_path: Path) -> None:
    (tmp_path / "cnn_lstm.onnx").write_bytes(net[1].read_bytes())
    export_forest(forest(5), tmp_path / "touch_pattern_rf.onnx", Facts(**CARD), FEATURES)
    write_manifest(tmp_path, {"cnn_lstm": {"accuracy": 0.97}})
    models = json.loads((tmp_path / "manifest.json").read_text())["models"]
    assert sorted(models) == ["cnn_lstm.onnx", "touch_pattern_rf.onnx"]
    for name, entry in models.items():
        data = (tmp_path / name).read_bytes()
        assert entry["sha256"] == hashlib.sha256(data).hexdigest()
        assert (entry["size"], entry["version"], entry["gestures"]) == (len(data), "1.2.0", list(GESTURES))
    assert models["cnn_lstm.onnx"]["figures"] == {"accuracy": 0.97}


def test_figures_are_of_the_very_file_that_was_measured(net: tuple[Net, Path], tmp_path: Path) -> None:
    path = tmp_path / "cnn_lstm.onnx"
    path.write_bytes(net[1].read_bytes())
    assert measured(path) == {}
    write_manifest(tmp_path, {"cnn_lstm": {"accuracy": 0.97}})
    assert measured(path) == {"accuracy": 0.97}
    export_net(net[0], path, Facts(**CARD | {"version": "1.2.1"}))
    assert measured(path) == {}


@pytest.mark.parametrize("text", ["<<<<<<< ours", "[]", '{"models": []}'])
def test_a_manifest_that_is_none_is_named(text: str, tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(ModelError, match=r"manifest\.json: expected what gestured-lab evaluate writes"):
        measured(tmp_path / "cnn_lstm.onnx")
