"""A small real model file of two gestures, and what can be wrong with one; and a clock for a ladder of models."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gestured.core.frames import Segment
from gestured.core.window import Window
from gestured.model.features import feature_names
from gestured.model.file import SelfTest
from tests.daemon.trust import MAKER

WINDOW = Window(rows=9, columns=9, rate_hz=15.0, smooth_frames=1, lead_s=0.1, tail_s=0.1, floor=4.0)
GESTURES = ("one_tap", "swipe_up")


STRICTER = {"eager": 0.3, "normal": 0.6, "strict": 0.9}  # thresholds of the points that `operating_points` makes


def operating_points(gestures: Sequence[str] = GESTURES, **changes: Any) -> str:
    """The metadata `operating_points` of a model of these gestures, `changes` in place of what stands there."""
    made = {
        name: {
            "thresholds": dict.fromkeys(gestures, least), "provisional": None if name == "eager" else least + 0.05,
            "missed": round(least / 10, 3), "false_per_hour": round(4 * (1 - least), 3), "hours": 12.0,
        }
        for name, least in STRICTER.items()
    }  # fmt: skip
    curve = [[k / 20, k / 200, 5 - k / 4] for k in range(1, 20)]
    return json.dumps(made | {"curve": curve} | changes)


@dataclass
class Clock:
    """Time that tests set, and that runs of models take."""

    now: float = 0.0  # s

    def __call__(self) -> float:
        return self.now


def segment(frames: int = 6, level: float = 100.0) -> Segment:
    """A finger that moves along a row."""
    values = np.zeros((frames, 9, 9), np.float32)
    for t in range(frames):
        values[t, 4, min(t, 8)] = level
    return Segment(values, np.arange(frames) / 15.0, 0, frames - 1, 1.0)


def softmax(x: np.ndarray) -> np.ndarray:
    e = np.exp(x - x.max(axis=1, keepdims=True))
    return e / e.sum(axis=1, keepdims=True)


def oracle(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the test's model computes: scores from the mean of its input, unknown from the largest value."""
    axes = tuple(range(1, inputs.ndim))
    mean = inputs.mean(axis=axes)
    return softmax(np.stack([40 * mean, 0 * mean], 1)), 1 / (1 + np.exp(2 * inputs.max(axis=axes)))


def properties(takes: str = "frames") -> dict[str, str]:
    """The metadata of the test's model."""
    names = feature_names(9, 9)
    shape = (2, len(names)) if takes == "features" else (2, 5, 9, 9)
    example = 0.05 * np.random.default_rng(1).random(shape, np.float32)
    made = {
        "gestures": json.dumps(GESTURES),
        "kind": "test_net",
        "version": "3",
        "rows": "9",
        "columns": "9",
        "rate_hz": "15.0",
        "window": WINDOW.to_json(),
        "calibration": '{"temperature": 1.5}',
        "self_test": SelfTest(example, *oracle(example)).to_json(),
        "training_data": "0" * 64,
        "quantiles": '{"duration_s": [0.1, 0.5]}',
    }
    return made | ({"features": json.dumps(names)} if takes == "features" else {})


def build(
    path: Path,
    *,
    takes: str = "frames",
    shape: tuple[int | str, ...] | None = None,
    number: str = "float",
    outputs: tuple[str, ...] = ("scores", "unknown"),
    gain: float = 40.0,
    classes: int = 2,
    extra: str = "",
    drop: tuple[str, ...] = (),
    keep_graph: bool = True,
    maker: str = MAKER,
    **metadata: str,
) -> Path:
    """A small real ONNX model with everything that the contract asks for; the arguments break it.

    Without its `maker` it is tried in a process of its own, as somebody else's is (tests/daemon/trust.py).
    """
    pytest.importorskip("onnx", reason="building test models needs the extra [lab]")
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    features = takes == "features"
    names = feature_names(9, 9)
    if shape is None:
        shape = ("B", len(names)) if features else ("B", "T", 9, 9)
    dtype = {"float": TensorProto.FLOAT, "double": TensorProto.DOUBLE}[number]
    scalar = {"float": np.float32, "double": np.float64}[number]
    axes = list(range(1, len(shape)))
    weights = np.zeros((1, classes), scalar)
    weights[0, 0] = gain
    nodes = [
        helper.make_node("ReduceMean", [takes], ["mean"], axes=axes, keepdims=0),
        helper.make_node("ReduceMax", [takes], ["max"], axes=axes, keepdims=0),
        helper.make_node("Unsqueeze", ["mean", "one"], ["column"]),
        helper.make_node("MatMul", ["column", "weights"], ["logits"]),
        helper.make_node("Softmax", ["logits"], [outputs[0]], axis=1),
        helper.make_node("Mul", ["max", "minus_two"], ["negative"]),
        helper.make_node("Sigmoid", ["negative"], [outputs[1]]),
    ]
    tensors = [
        numpy_helper.from_array(np.array([1], np.int64), "one"),
        numpy_helper.from_array(weights, "weights"),
        numpy_helper.from_array(scalar(-2), "minus_two"),
    ]
    if extra == "no probabilities":
        nodes[4] = helper.make_node("Identity", ["logits"], [outputs[0]])
    if extra in ("bomb", "small bomb"):  # 16 GiB, or 1, asked for in a few bytes
        count = 1 << (32 if extra == "bomb" else 28)
        tensors.append(numpy_helper.from_array(np.array([count], np.int64), "huge"))
        nodes += [
            helper.make_node("ConstantOfShape", ["huge"], ["big"]),
            helper.make_node("ReduceSum", ["big"], ["nothing"], keepdims=0),
            helper.make_node("Add", ["negative", "nothing"], ["boom"]),
        ]
        nodes = nodes[:6] + nodes[7:] + [helper.make_node("Sigmoid", ["boom"], [outputs[1]])]
    if extra == "external":
        tensors[2].ClearField("raw_data")
        tensors[2].data_location = TensorProto.EXTERNAL
        tensors[2].external_data.add(key="location", value="/etc/hostname")
    if extra == "lying dims":
        tensors[1].dims[0] = 1 << 32
    inputs = [helper.make_tensor_value_info(takes, dtype, shape)]
    if extra == "two inputs":
        inputs.append(helper.make_tensor_value_info("more", dtype, shape))
        nodes.append(helper.make_node("Identity", ["more"], ["unused"]))
    graph = helper.make_graph(
        nodes,
        "test",
        inputs,
        [
            helper.make_tensor_value_info(outputs[0], dtype, ["B", classes]),
            helper.make_tensor_value_info(outputs[1], dtype, ["B"]),
        ],
        tensors,
    )
    proto = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    proto.producer_name = "" if extra else maker
    props = properties(takes) | metadata
    helper.set_model_props(proto, {k: v for k, v in props.items() if k not in drop})
    if not keep_graph:
        proto.ClearField("graph")
    path.write_bytes(proto.SerializeToString())
    assert onnx is not None
    return path
