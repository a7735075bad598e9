"""The ways to run a shipped model agree; and the references are what they claim to be."""

import numpy as np
import onnx
import pytest
from onnx import TensorProto

from gestured.lab.adapt.weights import base_of
from gestured.lab.dataset import cuts
from gestured.lab.fit import RECURRENT
from gestured.lab.stability.path import simulated_series
from gestured.lab.stability.ways import by_frames, by_onnxruntime, by_reference, by_torch, widened
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER, shipped

TOLERANCE = 2e-6


@pytest.fixture(scope="module")
def windows() -> list[np.ndarray]:
    window = open_model(LADDER[0]).metadata.window
    return [window.apply(segment) for _, stream in simulated_series(6) for segment in cuts(stream.frames, stream.times)]


@pytest.mark.parametrize("name", RECURRENT)
def test_every_way_to_run_a_net_gives_the_same(name: str, windows: list[np.ndarray]) -> None:
    data = shipped()[name].read_bytes()
    module = base_of(name).judged
    right = by_reference(data)(windows)
    assert np.abs(right[:, :-1].sum(axis=1) - 1.0).max() < 1e-9  # it is computed in float64
    ways = {
        "as the daemon": by_onnxruntime(data),
        "a batch": by_onnxruntime(data, batch=True),
        "two threads": by_onnxruntime(data, threads=2),
        "torch": by_torch(module),
        "torch, a batch": by_torch(module, batch=True),
        "frame by frame": by_frames(module),
    }
    for way, run in ways.items():
        assert np.abs(run(windows) - right).max() < TOLERANCE, way


def test_the_forest_walks_as_in_float64(windows: list[np.ndarray]) -> None:
    from gestured.core.features import touch_pattern

    data = shipped()["touch_pattern_rf"].read_bytes()
    features = [touch_pattern(window, 15.0) for window in windows]
    right = by_reference(data)(features)
    for run in (by_onnxruntime(data), by_onnxruntime(data, batch=True)):
        assert np.abs(run(features) - right).max() < TOLERANCE


def test_a_widened_graph_holds_no_float32() -> None:
    graph = widened(shipped()["lstm"].read_bytes()).graph
    tensors = [
        *graph.initializer,
        *(a.t for n in graph.node for a in n.attribute if a.type == onnx.AttributeProto.TENSOR),
    ]
    assert {tensor.data_type for tensor in tensors} >= {TensorProto.DOUBLE}
    assert TensorProto.FLOAT not in {tensor.data_type for tensor in tensors}
