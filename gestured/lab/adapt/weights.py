"""The networks of a model file, as they were trained: what `adapt` starts from.

An .onnx file holds every weight under its name in torch, with two exceptions: ONNX keeps the gates of an LSTM in
another order and without names, and the shares of both opinions are in the calibration. The networks that were read are
checked: they must answer as the file does.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import numpy_helper
from torch import Tensor, nn

from gestured.core.errors import ModelError
from gestured.lab.export import PARITY
from gestured.lab.fit import CLASSES, RECURRENT, build
from gestured.lab.nets import HIDDEN, UNITS, Decision, Judged, Opinion, Verifier
from gestured.lab.samples import WINDOW
from gestured.model.context import NAMES, calm
from gestured.model.file import read_bytes
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.simulator import GESTURES

GATES = [0, 2, 3, 1]  # torch's order i f g o, in ONNX's i o f c


@dataclass(frozen=True)
class Base:
    """A model that can be adapted: its file's answers, and its networks."""

    model: Model
    judged: Judged

    @property
    def kind(self) -> str:
        """The name of the kind, one of `RECURRENT`."""
        return self.model.metadata.kind


def base_of(source: str) -> Base:
    """The networks of a model file, or of a shipped model by its name. Raises ModelError, also for a forest."""
    model = open_model(source if source in shipped() else Path(source))
    path = shipped().get(source, Path(source))
    metadata = model.metadata
    if metadata.kind not in RECURRENT:
        raise ModelError(f"{path}: is not adaptable: its kind is {metadata.kind}, expected {' or '.join(RECURRENT)}")
    if metadata.gestures != tuple(GESTURES) or metadata.window != WINDOW:
        raise ModelError(f"{path}: is not adaptable: expected the gestures and the window that this version trains")
    if json.loads(model.properties.get("classes", "null")) not in (None, CLASSES):
        raise ModelError(f"{path}: is not adaptable: expected the classes that this version trains")
    try:
        judged = read(onnx.load_model_from_string(read_bytes(path)), metadata.kind, metadata.calibration)
        _compare(judged, model)
    except ValueError as error:
        raise ModelError(f"{path}: is not adaptable: {error}") from error
    return Base(model, judged)


def untrained(kind: str) -> Judged:
    """The networks of a kind, their decision and their verifier, before anything was learned."""
    nets = build()
    net, trajectory = nets[kind], nets["trajectory"]
    assert isinstance(net, Opinion)
    assert isinstance(trajectory, Opinion)
    verifier = Verifier(Decision.CUES, UNITS + HIDDEN, len(NAMES))
    return Judged(net, trajectory, Decision(len(GESTURES)), verifier).eval()


def read(proto: onnx.ModelProto, kind: str, calibration: Mapping[str, Any]) -> Judged:
    """The networks of an ONNX graph, their decision and their verifier.

    Raises ValueError if the graph and the calibration do not hold every weight.
    """
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in proto.graph.initializer}
    judged = untrained(kind)
    found = _recurrent(judged, proto, stored) | _shares(calibration.get("temperature")) | _rejection(calibration)
    state = {}
    for name, expected in judged.state_dict().items():
        value = found.get(name, stored.get(name))
        if value is None:
            raise ValueError(f"it does not hold {name}")
        if value.shape != tuple(expected.shape):
            raise ValueError(f"{name}: expected the shape {tuple(expected.shape)}, found {value.shape}")
        state[name] = torch.tensor(value, dtype=expected.dtype)
    judged.load_state_dict(state)
    return judged


def _recurrent(
    judged: Judged, proto: onnx.ModelProto, stored: Mapping[str, NDArray[np.generic]]
) -> dict[str, NDArray[np.generic]]:
    """The weights of every LSTM, under torch's names; the graph has them in the order of the modules."""
    layers = [name for name, module in judged.named_modules() if isinstance(module, nn.LSTM)]
    nodes = [node for node in proto.graph.node if node.op_type == "LSTM"]
    if len(nodes) != len(layers) or any(name not in stored for node in nodes for name in node.input[1:4]):
        raise ValueError(f"expected {len(layers)} LSTM with weights in the file, found {len(nodes)}")
    found = {}
    for layer, node in zip(layers, nodes, strict=True):
        w, r, b = (stored[name][0] for name in node.input[1:4])
        units = r.shape[-1]
        if w.shape[0] != 4 * units or b.shape != (8 * units,):
            raise ValueError("expected an LSTM of one direction with two biases")
        rows = np.concatenate([np.arange(units) + gate * units for gate in GATES])
        halves = b.reshape(2, 4 * units)
        for part, value in (
            ("weight_ih", w), ("weight_hh", r), ("bias_ih", halves[0]), ("bias_hh", halves[1]),
        ):  # fmt: skip
            found[f"{layer}.{part}_l0"] = value[rows]
    return found


def _shares(temperatures: object) -> dict[str, NDArray[np.generic]]:
    """The weight of each opinion, of which the calibration holds the inverse."""
    if not isinstance(temperatures, list) or len(temperatures) != 2 or not all(
        isinstance(value, int | float) and value > 0 for value in temperatures
    ):  # fmt: skip
        raise ValueError(f"calibration: temperature: expected two numbers above 0, found {json.dumps(temperatures)}")
    return {"decision.share": 1 / np.array(temperatures, np.float64)}


def _rejection(calibration: Mapping[str, Any]) -> dict[str, NDArray[np.generic]]:
    """The weights by which the decision alone would reject; the graph lacks them, since its verifier does that."""
    weight, bias = calibration.get("unknown_weight"), calibration.get("unknown_bias")
    if not isinstance(weight, list) or not all(isinstance(value, int | float) for value in (*weight, bias)):
        raise ValueError("calibration: unknown_weight and unknown_bias: expected numbers")
    return {"decision.weight": np.array(weight, np.float64), "decision.bias": np.array(bias, np.float64)}


def _compare(judged: Judged, model: Model) -> None:
    """Raises ValueError if the networks answer the self-test or noise otherwise than the file."""
    noise = np.random.default_rng(1).random((3, 20, WINDOW.rows, WINDOW.columns), np.float32)
    for values in (model.metadata.self_test.values, noise):
        expected = model.run(values)
        with torch.no_grad():
            around = torch.from_numpy(calm(len(values), NAMES))
            found: tuple[Tensor, ...] = judged(torch.from_numpy(values), around)
        largest = max(float(np.abs(one.numpy() - other).max()) for one, other in zip(found, expected, strict=False))
        if not largest <= PARITY:
            raise ValueError(f"its weights, read back, answer by up to {largest:.2g} otherwise than the file")
