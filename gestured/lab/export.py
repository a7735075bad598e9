"""Trained networks and forests -> .onnx files that say all about themselves; and the manifest over them.

Every file is verified before it is written: ONNX's checker, everything that the daemon checks, and outputs
against the trained model's own within `PARITY`, for batches and windows of many lengths.
"""

import hashlib
import json
import math
import os
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from sklearn.ensemble import RandomForestClassifier

from gestured.core.errors import ModelError
from gestured.core.window import Window
from gestured.model_file import SelfTest, inspect
from gestured.models import Model

OPSET = 17
PARITY = 1e-4
BATCHES = (1, 2, 7)
LENGTHS = (1, 2, 15, 60, 500)  # frames
LEAST = 1e-3  # a forest's probabilities are not trusted below this, nor above 1 - this

Outputs = tuple[NDArray[np.float32], NDArray[np.float32]]  # scores (B, G), unknown (B,)


def export_net(
    module: torch.nn.Module,
    path: str | Path,
    *,
    kind: str,
    version: str,
    gestures: Sequence[str],
    window: Window,
    calibration: Mapping[str, Any],
    training_data: str,
    quantiles: Mapping[str, Any],
) -> dict[str, float]:
    """Write a torch module whose `forward` takes frames (B, T, R, C) and gives calibrated outputs.

    `forward` returns (scores (B, G), unknown (B,)). B and T stay open. Gives the file's size in bytes and the
    largest difference from torch; raises ModelError where it is above `PARITY` or a check fails.
    """
    module = module.eval()
    rows, columns = window.rows, window.columns

    def truth(frames: NDArray[np.float32]) -> Outputs:
        with torch.no_grad():
            scores, unknown = module(torch.from_numpy(frames))
        return scores.numpy(), unknown.numpy()

    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as directory:
        traced = Path(directory) / "traced.onnx"
        # The tracer warns of whatever could be frozen into the graph; `_compare` finds what is.
        warnings.simplefilter("ignore")
        # Not dynamo: with an LSTM its second export in a process silently fixes T (torch 2.13).
        # An example batch of 2, so that no dimension is taken for a constant 1.
        torch.onnx.export(
            module,
            (torch.from_numpy(_windows(2, 5, rows, columns)),),
            traced,
            dynamo=False,
            opset_version=OPSET,
            input_names=["frames"],
            output_names=["scores", "unknown"],
            dynamic_axes={"frames": {0: "B", 1: "T"}, "scores": {0: "B"}, "unknown": {0: "B"}},
        )
        proto = onnx.load(traced)
    example = np.round(_windows(2, 12, rows, columns), 3)
    metadata = _metadata(kind, version, gestures, window, calibration, training_data, quantiles)
    inputs = [_windows(b, t, rows, columns) for b in BATCHES for t in LENGTHS]
    return _finish(proto, Path(path), metadata, example, truth, inputs)


def export_forest(
    forest: RandomForestClassifier,
    path: str | Path,
    *,
    kind: str,
    version: str,
    gestures: Sequence[str],
    window: Window,
    calibration: Mapping[str, Any],
    training_data: str,
    quantiles: Mapping[str, Any],
    features: Sequence[str],
) -> dict[str, float]:
    """Write a random forest over `features`; its classes are 0 .. G-1 for the gestures, the others for none.

    The outputs are those of `forest_outputs`. Gives the file's size in bytes and the largest difference from
    scikit-learn; raises ModelError where it is above `PARITY` or a check fails.
    """
    count = len(gestures)
    if not np.array_equal(forest.classes_, np.arange(len(forest.classes_))) or len(forest.classes_) < count:
        raise ModelError(
            f"{path}: the forest's classes are {forest.classes_}, expected 0, 1 ... {count - 1} first"
        )
    if forest.n_features_in_ != len(features):
        raise ModelError(
            f"{path}: the forest takes {forest.n_features_in_} features, expected {len(features)}"
        )

    def truth(values: NDArray[np.float32]) -> Outputs:
        return forest_outputs(forest.predict_proba(values), count, calibration)

    sample = _around_thresholds(forest, 508)
    metadata = _metadata(kind, version, gestures, window, calibration, training_data, quantiles)
    metadata["features"] = json.dumps(list(features))
    inputs = [sample[start : start + size] for start, size in ((0, 1), (1, 2), (3, 5), (8, 500))]
    return _finish(_forest_graph(forest, count, calibration), Path(path), metadata, sample[:4], truth, inputs)


def forest_outputs(probabilities: NDArray[Any], gestures: int, calibration: Mapping[str, Any]) -> Outputs:
    """(B, classes) probabilities of a forest -> calibrated scores (B, G) and unknown (B,), as in the file.

    scores = softmax(log p / `temperature`) over the gestures; unknown = sigmoid(`unknown_scale` * logit(none)
    + `unknown_offset`), none being what the gestures leave. Without these keys: 1, 1 and 0.
    """
    temperature, scale, offset = _calibration(calibration)
    named = np.asarray(probabilities, np.float64)[:, :gestures]
    logits = np.log(np.maximum(named, LEAST)) / temperature
    powers = np.exp(logits - logits.max(axis=1, keepdims=True))
    none = np.clip(1.0 - named.sum(axis=1), LEAST, 1.0 - LEAST)
    unknown = 1.0 / (1.0 + np.exp(-(scale * np.log(none / (1.0 - none)) + offset)))
    scores = powers / powers.sum(axis=1, keepdims=True)
    return scores.astype(np.float32), unknown.astype(np.float32)


def write_manifest(directory: str | Path, figures: Mapping[str, Any]) -> Path:
    """Write `manifest.json` over the directory's .onnx files.

    `figures` holds what was measured of each, by file name without suffix. Raises ModelError for a file that
    has no metadata.
    """
    models = {}
    for path in sorted(Path(directory).glob("*.onnx")):
        data = path.read_bytes()
        try:
            said = inspect(data)
            models[path.name] = {
                "sha256": hashlib.sha256(data).hexdigest(),
                "size": len(data),
                "kind": said["kind"],
                "version": said["version"],
                "gestures": json.loads(said["gestures"]),
                "figures": figures.get(path.stem, {}),
            }
        except (ValueError, KeyError) as error:
            raise ModelError(f"{path}: {error}") from None
    target = Path(directory) / "manifest.json"
    _write(target, (json.dumps({"models": models}, indent=2) + "\n").encode())
    return target


def _metadata(
    kind: str,
    version: str,
    gestures: Sequence[str],
    window: Window,
    calibration: Mapping[str, Any],
    training_data: str,
    quantiles: Mapping[str, Any],
) -> dict[str, str]:
    return {
        "gestures": json.dumps(list(gestures)),
        "kind": kind,
        "version": version,
        "rows": str(window.rows),
        "columns": str(window.columns),
        "rate_hz": repr(window.rate_hz),
        "window": window.to_json(),
        "calibration": json.dumps(dict(calibration), allow_nan=False),
        "training_data": training_data,
        "quantiles": json.dumps(dict(quantiles), allow_nan=False),
    }


def _finish(
    proto: onnx.ModelProto,
    path: Path,
    metadata: dict[str, str],
    example: NDArray[np.float32],
    truth: Callable[[NDArray[np.float32]], Outputs],
    inputs: Sequence[NDArray[np.float32]],
) -> dict[str, float]:
    """Metadata and self-test into the model, everything checked, then the file at once."""
    proto.producer_name, proto.producer_version, proto.doc_string = "gestured", metadata["version"], ""
    proto.graph.name, proto.graph.doc_string = metadata["kind"], ""
    for node in proto.graph.node:
        node.doc_string = ""  # may hold paths of the machine that trained it
    scores, unknown = truth(example)
    helper.set_model_props(proto, metadata | {"self_test": SelfTest(example, scores, unknown).to_json()})
    try:
        onnx.checker.check_model(proto, full_check=True)
        data = proto.SerializeToString(deterministic=True)
        largest = _compare(Model(data, path.stem), truth, inputs)
    except (ValueError, onnx.checker.ValidationError, onnx.shape_inference.InferenceError) as error:
        raise ModelError(f"{path}: not written: {error}") from None
    _write(path, data)
    return {"size": len(data), "largest_difference": largest}


def _compare(
    model: Model, truth: Callable[[NDArray[np.float32]], Outputs], inputs: Sequence[NDArray[np.float32]]
) -> float:
    """The largest difference between the file and the trained model, and between a batch and its members."""
    largest = 0.0
    for batch in inputs:
        found, expected = model.run(batch), truth(batch)
        alone = [model.run(batch[k : k + 1]) for k in range(min(len(batch), 7))]
        for one, other in (
            *zip(found, expected, strict=True),
            *((found[n][: len(alone)], np.concatenate([a[n] for a in alone])) for n in (0, 1)),
        ):
            difference = float(np.abs(one - other).max()) if one.shape == other.shape else math.inf
            largest = max(largest, difference)
            if not difference <= PARITY:
                raise ValueError(
                    f"outputs differ by {difference:.3g} from the trained model's, or a batch's from its "
                    f"members', for an input of shape {batch.shape}; expected {PARITY} at most"
                )
    return largest


def _windows(batch: int, length: int, rows: int, columns: int) -> NDArray[np.float32]:
    """(B, T, R, C) windows, the same on every call: moving blobs, faint noise, quiet frames at the end.

    Of more than four one is all quiet and one all noise, which a recording cannot give but a net must bear.
    """
    random = np.random.default_rng([batch, length, rows, columns])
    t = np.linspace(0.0, 1.0, length)[:, None, None]
    row, column = np.mgrid[0:rows, 0:columns]
    out = np.empty((batch, length, rows, columns))
    for k in range(batch):
        start, end = random.uniform(0, [rows, columns], (2, 2))
        place = start + (end - start) * t
        distance = (row - place[..., :1]) ** 2 + (column - place[..., 1:]) ** 2
        out[k] = np.exp(-distance / 2.0) * np.sin(np.pi * (0.1 + 0.8 * t))
    out += 0.01 * random.random(out.shape)
    out[:, length - length // 5 :] *= 0.02
    out /= out.max(axis=(1, 2, 3), keepdims=True)
    if batch > 4:
        out[3] = 0.0
        out[4] = random.random(out[4].shape)
    return out.astype(np.float32)


def _around_thresholds(forest: RandomForestClassifier, count: int) -> NDArray[np.float32]:
    """(count, F) features that reach every corner of the forest: on, just below and above its thresholds."""
    random = np.random.default_rng(0)
    used = np.concatenate([tree.tree_.feature for tree in forest.estimators_])
    thresholds = np.concatenate([tree.tree_.threshold for tree in forest.estimators_])
    out = np.zeros((count, forest.n_features_in_), np.float32)
    for feature in range(forest.n_features_in_):
        known = thresholds[used == feature]
        if len(known):
            out[:, feature] = random.choice(known, count)
    aside = random.integers(-1, 2, out.shape)
    return np.where(
        aside == 0, out, np.nextafter(out, np.where(aside > 0, np.inf, -np.inf).astype(np.float32))
    )


def _calibration(calibration: Mapping[str, Any]) -> tuple[float, float, float]:
    values = (
        float(calibration.get("temperature", 1.0)),
        float(calibration.get("unknown_scale", 1.0)),
        float(calibration.get("unknown_offset", 0.0)),
    )
    if not all(map(math.isfinite, values)) or values[0] <= 0:
        raise ModelError(f"calibration: expected finite numbers and a temperature above 0, found {values}")
    return values


def _forest_graph(
    forest: RandomForestClassifier, gestures: int, calibration: Mapping[str, Any]
) -> onnx.ModelProto:
    """The forest as tables that all trees walk at once, a level of depth at a time.

    Not ONNX's tree ensemble: that is four times as large on disk, takes 200 MiB and more when it is opened
    and a third of a second (173,000 nodes), and this is walked as exactly.
    """
    temperature, scale, offset = _calibration(calibration)
    tables = _flatten(forest)
    constants = {
        **tables,
        "gesture_start": np.array([0], np.int64),
        "gesture_end": np.array([gestures], np.int64),
        "axis_one": np.array([1], np.int64),
        "zero": np.array([0], np.int64),
        "least": np.float32(LEAST),
        "most": np.float32(1.0 - LEAST),
        "one": np.float32(1.0),
        "temperature": np.float32(temperature),
        "scale": np.float32(scale),
        "offset": np.float32(offset),
    }
    nodes: list[onnx.NodeProto] = []

    def add(operator: str, inputs: Sequence[str], output: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(operator, list(inputs), [output], name=output, **attributes))
        return output

    add("Shape", ["features"], "shape")
    add("Gather", ["shape", "zero"], "batch")
    add("Concat", ["batch", "trees"], "walks", axis=0)
    at = add("Expand", ["root", "walks"], "at_0")  # (B, trees): the node at which each tree stands
    for level in range(max(tree.get_depth() for tree in forest.estimators_)):
        add("Gather", ["feature", at], f"feature_{level}")
        add("GatherElements", ["features", f"feature_{level}"], f"value_{level}", axis=1)
        add("Gather", ["threshold", at], f"threshold_{level}")
        add("Greater", [f"value_{level}", f"threshold_{level}"], f"greater_{level}")
        add("Cast", [f"greater_{level}"], f"right_{level}", to=TensorProto.INT32)
        add("Gather", ["left", at], f"left_{level}")
        at = add("Add", [f"left_{level}", f"right_{level}"], f"at_{level + 1}")
    add("Gather", ["leaf", at], "row")
    add("Gather", ["leaf_values", "row"], "votes")  # (B, trees, classes)
    add("ReduceMean", ["votes"], "probabilities", axes=[1], keepdims=0)
    add("Slice", ["probabilities", "gesture_start", "gesture_end", "axis_one"], "named")
    add("Max", ["named", "least"], "named_least")
    add("Log", ["named_least"], "named_log")
    add("Div", ["named_log", "temperature"], "logits")
    add("Softmax", ["logits"], "scores", axis=1)
    add("ReduceSum", ["named", "axis_one"], "named_sum", keepdims=0)
    add("Sub", ["one", "named_sum"], "none_all")
    add("Clip", ["none_all", "least", "most"], "none")
    add("Sub", ["one", "none"], "some")
    add("Div", ["none", "some"], "odds")
    add("Log", ["odds"], "logit")
    add("Mul", ["logit", "scale"], "scaled")
    add("Add", ["scaled", "offset"], "moved")
    add("Sigmoid", ["moved"], "unknown")
    floats = TensorProto.FLOAT
    graph = helper.make_graph(
        nodes,
        "forest",
        [helper.make_tensor_value_info("features", floats, ["B", forest.n_features_in_])],
        [
            helper.make_tensor_value_info("scores", floats, ["B", gestures]),
            helper.make_tensor_value_info("unknown", floats, ["B"]),
        ],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=8)


def _flatten(forest: RandomForestClassifier) -> dict[str, NDArray[Any]]:
    """All trees in one set of tables. A right child stands behind its left one; a leaf leads to itself.

    Thresholds are rounded down to float32, so that a float32 value goes the way it goes in scikit-learn,
    which compares with the float64.
    """
    features, thresholds, lefts, leaves, values, roots = [], [], [], [], [], []
    base = rows = 0
    for estimator in forest.estimators_:
        tree = estimator.tree_
        count = tree.node_count
        order = [0]  # new number -> old
        left = np.arange(count)
        for new in range(count):
            old = order[new]
            if tree.children_left[old] >= 0:
                left[new] = len(order)
                order += [tree.children_left[old], tree.children_right[old]]
        leaf = tree.children_left[order] < 0
        exact = tree.threshold[order]
        rounded = exact.astype(np.float32)
        rounded = np.where(rounded > exact, np.nextafter(rounded, np.float32(-np.inf)), rounded)
        features.append(np.where(leaf, 0, tree.feature[order]))
        thresholds.append(np.where(leaf, np.float32(np.inf), rounded))
        lefts.append(left + base)
        leaves.append(np.where(leaf, np.cumsum(leaf) - 1 + rows, 0))
        shares = tree.value[order, 0][leaf]
        values.append(shares / shares.sum(axis=1, keepdims=True))
        roots.append(base)
        base += count
        rows += int(leaf.sum())
    return {
        "feature": np.concatenate(features).astype(np.int32),
        "threshold": np.concatenate(thresholds).astype(np.float32),
        "left": np.concatenate(lefts).astype(np.int32),
        "leaf": np.concatenate(leaves).astype(np.int32),
        "leaf_values": np.concatenate(values).astype(np.float32),
        "root": np.array([roots], np.int32),
        "trees": np.array([len(roots)], np.int64),
    }


def _write(path: Path, data: bytes) -> None:
    """All of it or nothing, also when the machine stops half-way."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with temporary.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
