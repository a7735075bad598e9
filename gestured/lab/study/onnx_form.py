"""The study's networks and forests as ONNX graphs, and onnxruntime as the daemon uses it: one thread, no spinning."""

import logging
import tempfile
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier, RandomForestClassifier
from torch import Tensor, nn

from gestured.lab.forest_graph import OPSET, forest_graph
from gestured.lab.nets import last_active
from gestured.lab.study.boosted import Boosted
from gestured.lab.study.nets import SENSOR_SIDE
from gestured.simulator import GESTURES


@dataclass
class Graph:
    """A model's bytes; opened when it is first run, so that it can be sent to another process."""

    data: bytes
    _session: Any = field(default=None, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        return {"data": self.data, "_session": None}

    def run(self, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        """(1, ...) inputs -> (1, G) scores."""
        if self._session is None:
            import onnxruntime

            options = onnxruntime.SessionOptions()
            options.intra_op_num_threads = options.inter_op_num_threads = 1
            options.add_session_config_entry("session.intra_op.allow_spinning", "0")
            options.log_severity_level = 3
            self._session = onnxruntime.InferenceSession(self.data, options, providers=["CPUExecutionProvider"])
        found = self._session.run(None, {self._session.get_inputs()[0].name: inputs})
        return np.asarray(found[0])


class _AtTheEnd(nn.Module):
    """A sequence net asked after the last frame with contact."""

    def __init__(self, net: nn.Module) -> None:
        super().__init__()
        self.net = net

    def forward(self, x: Tensor) -> Tensor:
        logits: Tensor = self.net(x, last_active(x))
        return logits


def of_net(module: nn.Module, *, images: bool) -> Graph:
    """A trained network; batch, and time where there is one, stay open."""
    net = module.eval() if images else _AtTheEnd(module).eval()
    if images:
        return _traced(net, torch.rand(2, SENSOR_SIDE, SENSOR_SIDE), {0: "B"})
    return _traced(net, torch.rand(2, 5, SENSOR_SIDE, SENSOR_SIDE), {0: "B", 1: "T"})


def _traced(net: nn.Module, example: Tensor, axes: dict[int, str]) -> Graph:
    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
        warnings.simplefilter("ignore")  # the tracer's; tests compare the graph with the network
        path = Path(folder) / "net.onnx"
        torch.onnx.export(
            net, (example,), path, dynamo=False, opset_version=OPSET,
            input_names=["inputs"], output_names=["scores"], dynamic_axes={"inputs": axes, "scores": {0: "B"}},
        )  # fmt: skip
        return Graph(path.read_bytes())


def of_boosting(fitted: HistGradientBoostingClassifier) -> Graph:
    """Gradient boosting on trajectory features, from the frames on."""
    return _traced(Boosted(fitted).eval(), torch.rand(2, 5, SENSOR_SIDE, SENSOR_SIDE), {0: "B", 1: "T"})


def of_forest(forest: RandomForestClassifier) -> Graph:
    """A random forest as the tables that the daemon walks."""
    return Graph(forest_graph(forest, len(GESTURES), {}).SerializeToString(deterministic=True))


def quantised(graph: Graph) -> Graph | None:
    """Weights of matrix products and LSTMs as int8, activations quantised as they come; None where nothing is."""
    from onnxruntime.quantization import QuantType, quantize_dynamic

    with tempfile.TemporaryDirectory() as folder:
        before, after = Path(folder) / "float32.onnx", Path(folder) / "int8.onnx"
        before.write_bytes(graph.data)
        logging.disable(logging.WARNING)  # it recommends a step that changes nothing here
        quantize_dynamic(before, after, op_types_to_quantize=["MatMul", "Gemm", "LSTM"], weight_type=QuantType.QInt8)
        logging.disable(logging.NOTSET)
        proto = onnx.load(after)
        kept = [entry for entry in proto.metadata_props if entry.key != "digest"]  # it was of the graph before
        del proto.metadata_props[:]
        proto.metadata_props.extend(kept)
        data = proto.SerializeToString(deterministic=True)
    return Graph(data) if len(data) < len(graph.data) else None
