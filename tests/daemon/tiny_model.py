"""A real model file, small and made by hand, so that the daemon's tests depend on no training.

It looks at where the pressure's centroid goes over time: along an axis is a swipe, nowhere is a tap (or two,
if it took long), and what takes very long is unknown.
"""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from gestured.simulator import GESTURES as GESTURES  # tests name the small model's gestures as tiny_model.GESTURES
from tests.daemon.trust import MAKER

ROWS = COLUMNS = 9
PROVISIONAL = '{"in_a_row": 1, "elapsed_s": [0.0, 0.1], "thresholds": [null, 0.9], "tap": 0.8}'


def own() -> str:
    """The metadata `own` of this model: as if it had been learned that movements spread by 0.1, and durations by 1."""
    from gestured.model.prototypes import Space

    far = 100.0  # where nothing is performed: what it cannot see
    places = np.full((len(GESTURES), 3), far)
    for name, place in {
        "one_tap": (0, 0, -4), "double_tap": (0, 0, 4), "swipe_down": (0, 17, 0), "swipe_up": (0, -17, 0),
        "swipe_right": (17, 0, 0), "swipe_left": (-17, 0, 0),
    }.items():  # fmt: skip
        places[GESTURES.index(name)] = place
    directions, between = np.diag([10.0, 10.0, 1.0]), np.full(3, 100.0)
    built_in = np.stack([places, np.ones_like(places)])
    return Space(np.array([0.0, 0.0, 4.0]), directions, between, built_in, (0.0,) * 5, 1.0, 5.0).to_json()


def make(path: Path, *, gestures: tuple[str, ...] = GESTURES, version: str = "1", **metadata: str) -> Path:
    """Write the model to `path`.

    `metadata` are further ones: `quantiles`; `provisional`, how sure it must be of a contact that is not over;
    `own`, with which it has an embedding: movement across, movement down, spread in time.
    The test is skipped where the onnx package is not installed.
    """
    onnx = pytest.importorskip("onnx", reason="the tests' own model is made with the onnx package")
    from onnx import TensorProto, helper, numpy_helper

    from gestured.core.window import Window
    from gestured.model.file import SelfTest

    count = len(gestures)
    base = np.full(count, -20, np.float32)  # what it can never see
    base[:2] = 4, 0
    by_dx, by_dy, by_time = np.zeros((3, count), np.float32)
    by_dy[2], by_dy[3], by_dx[4], by_dx[5] = 8, -8, 8, -8
    base[2:6] = -8
    by_time[1], by_time[0] = 1, -1
    constants = {
        "x": np.arange(COLUMNS, dtype=np.float32).reshape(1, 1, 1, COLUMNS),
        "y": np.arange(ROWS, dtype=np.float32).reshape(1, 1, ROWS, 1),
        "all": np.array([1, 2, 3], np.int64),
        "grid": np.array([2, 3], np.int64),
        "time_axis": np.array(1, np.int64),
        "tiny": np.array(1e-6, np.float32),
        "zero": np.array(0, np.float32),
        "one": np.array(1, np.float32),
        "base": base,
        "by_dx": by_dx,
        "by_dy": by_dy,
        "by_time": by_time,
        "two": np.array(2.5, np.float32),
        "long": np.array(40, np.float32),
        "flat1": np.array([-1], np.int64),
    }
    n = helper.make_node
    nodes = [
        n("ReduceSum", ["frames", "grid"], ["m0"], keepdims=1),  # (B, T, 1, 1) mass of each frame
        n("Mul", ["m0", "zero"], ["z"]),
        n("Add", ["z", "one"], ["ones"]),
        n("CumSum", ["ones", "time_axis"], ["t"]),
        n("ReduceSum", ["frames", "all"], ["s0"], keepdims=1),
        n("Add", ["s0", "tiny"], ["total"]),
    ]
    for axis in "txy":
        nodes += [
            n("Mul", ["frames", axis], [f"f{axis}"]),
            n("ReduceSum", [f"f{axis}", "all"], [f"s{axis}"], keepdims=1),
            n("Div", [f"s{axis}", "total"], [f"mean{axis}"]),
            n("Sub", [axis, f"mean{axis}"], [f"d{axis}"]),
            n("Mul", ["dt", f"d{axis}"], [f"p{axis}"]),
            n("Mul", ["frames", f"p{axis}"], [f"w{axis}"]),
            n("ReduceSum", [f"w{axis}", "all"], [f"c{axis}"], keepdims=1),
            n("Div", [f"c{axis}", "total"], [f"v{axis}"]),
        ]
    nodes += [
        n("Add", ["vt", "one"], ["vt1"]),
        n("Sqrt", ["vt1"], ["spread"]),
        *[n("Div", [f"v{axis}", "spread"], [f"k{axis}"]) for axis in "xy"],
        n("ReduceSum", ["kx", "grid"], ["kx2"], keepdims=0),  # (B, 1)
        n("ReduceSum", ["ky", "grid"], ["ky2"], keepdims=0),
        n("ReduceSum", ["vt", "grid"], ["vt2"], keepdims=0),
        n("Sub", ["vt2", "two"], ["late"]),
        n("Mul", ["kx2", "by_dx"], ["lx"]),
        n("Mul", ["ky2", "by_dy"], ["ly"]),
        n("Mul", ["late", "by_time"], ["lt"]),
        n("Sum", ["lx", "ly", "lt", "base"], ["logits"]),
        n("Softmax", ["logits"], ["scores"], axis=1),
        n("Sub", ["vt2", "long"], ["too_long"]),
        n("Sigmoid", ["too_long"], ["u"]),
        n("Reshape", ["u", "flat1"], ["unknown"]),
    ]
    value = helper.make_tensor_value_info
    outputs = [value("scores", TensorProto.FLOAT, ["B", count]), value("unknown", TensorProto.FLOAT, ["B"])]
    if "own" in metadata:
        nodes.append(n("Concat", ["kx2", "ky2", "vt2"], ["embedding"], axis=1))
        outputs.append(value("embedding", TensorProto.FLOAT, ["B", 3]))
    graph = helper.make_graph(
        nodes,
        "tiny",
        [value("frames", TensorProto.FLOAT, ["B", "T", ROWS, COLUMNS])],
        outputs,
        [numpy_helper.from_array(array, name) for name, array in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10, producer_name=MAKER)
    frames = np.random.default_rng(1).random((2, 7, ROWS, COLUMNS), np.float32)
    scores, unknown = _run(model.SerializeToString(), frames)
    window = Window(ROWS, COLUMNS, 15.0, 1, 0.0, 0.0, 5.0)
    helper.set_model_props(
        model,
        {
            "gestures": json.dumps(gestures),
            "kind": "tiny",
            "version": version,
            "rows": str(ROWS),
            "columns": str(COLUMNS),
            "rate_hz": "15.0",
            "window": window.to_json(),
            "calibration": "{}",
            "self_test": SelfTest(frames, scores, unknown).to_json(),
            "training_data": hashlib.sha256(b"").hexdigest(),
            "quantiles": "{}",
        }
        | metadata,
    )
    path.write_bytes(onnx.load_from_string(model.SerializeToString()).SerializeToString())
    return path


def _run(data: bytes, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    import onnxruntime

    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    scores, unknown = session.run(["scores", "unknown"], {"frames": frames})
    return scores, unknown
