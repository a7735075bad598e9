"""What is timed: every method, run as well as it can here, and the models that ship.

Networks and forests run in onnxruntime (one thread), as in the daemon, the rest in scikit-learn.
"""

import pickle
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gestured.core.frames import Segment
from gestured.lab.forest_graph import OPSET, forest_graph
from gestured.lab.progress import progress
from gestured.lab.samples import WINDOW
from gestured.lab.study.material import SHIFT, Data
from gestured.lab.study.methods import METHODS, Estimator
from gestured.lab.study.nets import SENSOR_SIDE, Answering, HistoryNet
from gestured.lab.study.plan import Plan
from gestured.lab.study.protocols import PARTICIPANTS, fitted, material
from gestured.lab.study.tables import TUNED, task
from gestured.lab.study.training import Net
from gestured.lab.study.views import Values
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.simulator import GESTURES

SHIPPED = {"cnn_lstm": "cnn_lstm", "lstm": "lstm", "tp_rf": "touch_pattern_rf"}  # methods, and the models that ship


class Runner(Protocol):
    """One model, from a segment to its answer."""

    method: str
    settings: str

    def answer(self, segment: Segment) -> tuple[int, bool]:
        """The class that it holds for the best, and whether it says so or rejects."""
        ...

    def size(self) -> int:
        """Bytes on disk."""
        ...


class Graph:
    """A network or a forest as ONNX, opened as the daemon does: one thread, no spinning."""

    def __init__(self, data: bytes) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        options.log_severity_level = 3
        self.data = data
        self._session = onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])

    @classmethod
    def of_net(cls, module: nn.Module) -> "Graph":
        """Of a trained network; batch, and time where there is one, stay open."""
        if isinstance(module, HistoryNet):
            return cls._traced(module, torch.rand(2, SENSOR_SIDE, SENSOR_SIDE), {0: "B"})
        return cls._traced(Answering(module), torch.rand(2, 5, SENSOR_SIDE, SENSOR_SIDE), {0: "B", 1: "T"})

    @classmethod
    def _traced(cls, net: nn.Module, example: Tensor, axes: dict[int, str]) -> "Graph":
        with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
            warnings.simplefilter("ignore")  # the tracer's; tests compare the graph with the network
            path = Path(folder) / "net.onnx"
            torch.onnx.export(
                net.eval(), (example,), path, dynamo=False, opset_version=OPSET,
                input_names=["inputs"], output_names=["scores"], dynamic_axes={"inputs": axes, "scores": {0: "B"}},
            )  # fmt: skip
            return cls(path.read_bytes())

    def run(self, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        """(1, ...) inputs -> (1, G) scores."""
        return np.asarray(self._session.run(["scores"], {self._session.get_inputs()[0].name: inputs})[0])


@dataclass
class Learned:
    """A method of the study, which rejects nothing."""

    method: str
    values: Values
    model: Estimator | Graph
    settings: str = TUNED

    def answer(self, segment: Segment) -> tuple[int, bool]:
        """As in `Runner`."""
        seen = METHODS[self.method].view.one(WINDOW.apply(segment), self.values)
        if isinstance(self.model, Estimator):
            return int(self.model.fitted.predict(seen)[0]), True
        return int(self.model.run(seen).argmax()), True

    def size(self) -> int:
        """The graph, or scikit-learn's own form."""
        return len(pickle.dumps(self.model.fitted)) if isinstance(self.model, Estimator) else len(self.model.data)


@dataclass
class Shipped:
    """A model that ships."""

    method: str
    path: Path
    model: Model
    settings: str = "shipped"

    def answer(self, segment: Segment) -> tuple[int, bool]:
        """As in `Runner`, by the model's own threshold."""
        found = self.model.classify(segment)
        best = int(found.values.argmax())
        name = self.model.gestures[best]
        return GESTURES.index(name), found.confidence >= found.threshold

    def size(self) -> int:
        """The file."""
        return self.path.stat().st_size


def runners(plan: Plan, tuned: Mapping[str, Values], data: Data) -> list[Runner]:
    """Every method, fitted to all gestures and their shifted copies, then the shipped models."""
    out: list[Runner] = []
    for method in progress(METHODS.values(), len(METHODS), "models to be timed"):
        of_task = task(method, tuned[method.id], SHIFT, PARTICIPANTS, "simulated", plan)
        of, inputs = material(of_task, data)
        model = fitted(of_task, inputs, np.arange(len(of.labels)), of.labels)
        values = dict(of_task.values)
        if isinstance(model, Net):
            out.append(Learned(method.id, values, Graph.of_net(model.module)))
        elif isinstance(model, Estimator) and method.id.endswith("_rf"):
            graph = forest_graph(model.fitted, len(GESTURES), {}).SerializeToString(deterministic=True)
            out.append(Learned(method.id, values, Graph(graph)))
        elif isinstance(model, Estimator):
            out.append(Learned(method.id, values, model))
    return out + [Shipped(method, shipped()[name], open_model(shipped()[name])) for method, name in SHIPPED.items()]
