"""The study's networks and forests as ONNX graphs, and onnxruntime as the daemon uses it: one thread, no spinning."""

import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestClassifier
from torch import Tensor, nn

from gestured.lab.forest_graph import OPSET, forest_graph
from gestured.lab.nets import last_active
from gestured.lab.study.nets import SENSOR_SIDE
from gestured.simulator import GESTURES


@dataclass
class Graph:
    """A model's bytes, opened."""

    data: bytes

    def __post_init__(self) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        options.log_severity_level = 3
        self._session = onnxruntime.InferenceSession(self.data, options, providers=["CPUExecutionProvider"])

    def run(self, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        """(1, ...) inputs -> (1, G) scores."""
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


def of_forest(forest: RandomForestClassifier) -> Graph:
    """A random forest as the tables that the daemon walks."""
    return Graph(forest_graph(forest, len(GESTURES), {}).SerializeToString(deterministic=True))
