"""The networks read back out of a model file: they answer as the file does, or nobody says that they do."""

import json
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import numpy_helper

from gestured.core.errors import ModelError
from gestured.lab.adapt.weights import base_of
from gestured.model.context import NAMES, calm
from tests.small_model import build


@pytest.mark.parametrize("name", ["cnn_lstm", "lstm"])
def test_a_shipped_model_is_read_back_to_its_last_answer(name: str) -> None:
    base = base_of(name)
    windows = np.random.default_rng(4).random((5, 33, 9, 9), np.float32)
    windows[:, 20:] *= 0.01  # idle frames at the end
    with torch.no_grad():
        found = base.judged(torch.from_numpy(windows), torch.from_numpy(calm(len(windows), NAMES)))
    for one, other in zip(found, base.model.run(windows), strict=False):
        np.testing.assert_allclose(one.numpy(), other, atol=1e-4)


def test_the_forest_and_foreign_models_are_not_adaptable(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="touch_pattern_rf.onnx: is not adaptable: its kind is touch_pattern_rf"):
        base_of("touch_pattern_rf")
    foreign = build(tmp_path / "foreign.onnx")
    with pytest.raises(ModelError, match="is not adaptable: its kind is test_net"):
        base_of(str(foreign))


def changed(base: Path, path: Path, change: str) -> Path:
    """A model whose file says something else than its graph computes with."""
    proto = onnx.load(str(base))
    if change == "temperature":
        (calibration,) = (p for p in proto.metadata_props if p.key == "calibration")
        calibration.value = json.dumps(json.loads(calibration.value) | {"temperature": [1.0, 9.0]})
    else:
        (weight,) = (t for t in proto.graph.initializer if t.name == "net.head.bias")
        for node in proto.graph.node:
            for k, name in enumerate(node.input):
                if name == "net.head.bias":
                    node.input[k] = "renamed"
        weight.CopyFrom(numpy_helper.from_array(numpy_helper.to_array(weight), "renamed"))
    kept = [one for one in proto.metadata_props if one.key != "digest"]
    del proto.metadata_props[:]
    proto.metadata_props.extend(kept)
    onnx.save(proto, str(path))
    return path


@pytest.mark.parametrize(
    ("change", "reason"), [("temperature", "its weights, read back, answer by up to"), ("name", "net.head.bias")]
)
def test_what_does_not_answer_as_the_file_does_is_refused(base: Path, tmp_path: Path, change: str, reason: str) -> None:
    with pytest.raises(ModelError, match=f"is not adaptable: .*{reason}"):
        base_of(str(changed(base, tmp_path / "other.onnx", change)))


def test_a_file_of_ones_own_is_read_back(base: Path) -> None:
    found = base_of(str(base))
    windows = np.random.default_rng(5).random((2, 21, 9, 9), np.float32)
    with torch.no_grad():
        scores = found.judged(torch.from_numpy(windows))[0]
    np.testing.assert_allclose(scores.numpy(), found.model.run(windows)[0], atol=1e-4)
