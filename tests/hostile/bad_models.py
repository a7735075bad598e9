"""Model files that pass every check, and misbehave when a touch lasts for more than two seconds."""

from pathlib import Path

FRAMES = 30  # of a segment; up to here they answer like the model that they are made from


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


def _make(good: Path, path: Path, nodes: list) -> Path:
    """`nodes` make `extra` (0 in a short segment) of `duration` (frames of the segment); it is added to the logits."""
    import numpy as np
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    model = onnx.load(good)
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
    path.write_bytes(model.SerializeToString())
    return path
