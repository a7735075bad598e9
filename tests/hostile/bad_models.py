"""Model files that misbehave: when they are read, when they are opened, or when a touch lasts longer than usual."""

from pathlib import Path
from typing import Any

import numpy as np

FRAMES = 30  # of a segment; up to here those that pass every check answer like the model that they are made from
KERNEL = 1_000_000  # values that one operator looks at for each of its answers


def failing(good: Path, path: Path) -> Path:
    """Answers what is no number."""
    from onnx import helper

    nodes = [
        helper.make_node("Sub", ["room", "duration"], ["left"]),
        helper.make_node("Sqrt", ["left"], ["not_a_number"]),
        helper.make_node("Mul", ["not_a_number", "nothing"], ["extra"]),
    ]
    return _make(good, path, nodes)


def hanging(good: Path, path: Path) -> Path:
    """Never comes back: a loop of 10^15 turns."""
    from onnx import TensorProto, helper

    value = helper.make_tensor_value_info
    body = helper.make_graph(
        [helper.make_node("Identity", ["go"], ["on"]), helper.make_node("Mul", ["v", "v"], ["w"])],
        "body",
        [value("i", TensorProto.INT64, []), value("go", TensorProto.BOOL, []), value("v", TensorProto.FLOAT, [])],
        [value("on", TensorProto.BOOL, []), value("w", TensorProto.FLOAT, [])],
    )
    nodes = [
        helper.make_node("Sub", ["duration", "room"], ["over"]),
        helper.make_node("Relu", ["over"], ["above"]),
        helper.make_node("Mul", ["above", "many"], ["turns"]),
        helper.make_node("Cast", ["turns"], ["count"], to=TensorProto.INT64),
        helper.make_node("Loop", ["count", "", "nothing"], ["extra"], body=body),
    ]
    return _make(good, path, nodes)


def stuck(good: Path, path: Path) -> Path:
    """Never comes back from a single operator, so that nobody can end the run: a million norms of a million values."""
    from onnx import TensorProto, helper

    nodes = [
        helper.make_node("Sub", ["duration", "room"], ["over"]),
        helper.make_node("Relu", ["over"], ["above"]),
        helper.make_node("Min", ["above", "at_most"], ["few"]),
        helper.make_node("Mul", ["few", "kernel"], ["further"]),
        helper.make_node("Add", ["further", "kernel"], ["width"]),
        helper.make_node("Cast", ["width"], ["count"], to=TensorProto.INT64),
        helper.make_node("Reshape", ["count", "as_vector"], ["vector"]),
        helper.make_node("Concat", ["one_row", "vector"], ["line"], axis=0),
        helper.make_node("Expand", ["nothing", "line"], ["values"]),
        helper.make_node("LpPool", ["values"], ["norms"], kernel_shape=[KERNEL], strides=[1]),
        helper.make_node("ReduceMax", ["norms"], ["extra"], keepdims=0),
    ]
    numbers = {
        "kernel": np.float32(KERNEL),
        "at_most": np.float32(1),
        "as_vector": np.array([1]),
        "one_row": np.array([1, 1]),
    }
    return _make(good, path, nodes, numbers)


def endless(good: Path, path: Path) -> Path:
    """Cannot be opened within hours: what is constant is worked out before anything runs, here the norms of `stuck`."""
    from onnx import helper

    nodes = [
        helper.make_node("Expand", ["nothing", "line"], ["values"]),
        helper.make_node("LpPool", ["values"], ["norms"], kernel_shape=[KERNEL], strides=[1]),
        helper.make_node("ReduceMax", ["norms"], ["extra"], keepdims=0),
    ]
    return _make(good, path, nodes, {"line": np.array([1, 1, 2 * KERNEL])})


def verbose(good: Path, path: Path) -> Path:
    """Some 30 MB of metadata, which would be gigabytes once they are parsed."""
    import onnx

    model = onnx.load(good)
    (quantiles,) = (entry for entry in model.metadata_props if entry.key == "quantiles")
    quantiles.value = '{"at": [' + "[]," * 10_000_000 + "[]]}"
    path.write_bytes(model.SerializeToString())
    return path


def _make(good: Path, path: Path, nodes: list[Any], numbers: dict[str, Any] | None = None) -> Path:
    """`nodes` make `extra` (0 in a short segment) of `duration` (frames of the segment); it is added to the logits."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    model = onnx.load(good)
    model.producer_name = ""  # it is not to be trusted (tests/daemon/trust.py)
    (softmax,) = (node for node in model.graph.node if node.op_type == "Softmax")
    at = list(model.graph.node).index(softmax)
    first = [
        helper.make_node("Shape", ["frames"], ["shape"], start=1, end=2),
        helper.make_node("Cast", ["shape"], ["length"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMax", ["length"], ["duration"], keepdims=0),
    ]
    last = helper.make_node("Add", [softmax.input[0], "extra"], ["disturbed"])
    softmax.input[0] = "disturbed"
    for node in reversed([*first, *nodes, last]):
        model.graph.node.insert(at, node)
    for name, number in (("room", FRAMES), ("nothing", 0), ("many", 1e15)):
        model.graph.initializer.append(numpy_helper.from_array(np.array(number, np.float32), name))
    for name, number in (numbers or {}).items():
        model.graph.initializer.append(numpy_helper.from_array(np.asarray(number), name))
    path.write_bytes(model.SerializeToString())
    return path
