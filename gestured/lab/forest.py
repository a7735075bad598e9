"""The forest at the ladder's end: grown on touch-pattern features, calibrated, and written as an ONNX graph.

Its classes are 0 .. G-1 for the gestures, the others for none. Its scores are calibrated by a temperature.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from sklearn.ensemble import RandomForestClassifier

from gestured.core.errors import ModelError
from gestured.lab.decide import Answers, confidence
from gestured.lab.fit import CLASSES, targets
from gestured.lab.quantiles import answer_figures
from gestured.lab.samples import Samples, join
from gestured.simulator import GESTURES

OPSET = 17
WHOLE = 65_535  # a leaf's shares are stored as parts of this
LEAST_CHANCE = 1e-3  # a forest's probabilities are not trusted below this, nor above 1 - this


def forest_outputs(probabilities: NDArray[Any], gestures: int, calibration: Mapping[str, Any]) -> Answers:
    """(B, classes) probabilities of a forest -> calibrated scores (B, G) and unknown (B,), as in the file.

    scores = softmax(log p / `temperature`) over the gestures; unknown is the probability that they leave.
    """
    temperature = _temperature(calibration)
    named = np.asarray(probabilities, np.float64)[:, :gestures]
    logits = np.log(np.maximum(named, LEAST_CHANCE)) / temperature
    powers = np.exp(logits - logits.max(axis=1, keepdims=True))
    unknown = np.clip(1.0 - named.sum(axis=1), LEAST_CHANCE, 1.0 - LEAST_CHANCE)
    scores = powers / powers.sum(axis=1, keepdims=True)
    return scores.astype(np.float32), unknown.astype(np.float32)


def forest_graph(forest: RandomForestClassifier, gestures: int, calibration: Mapping[str, Any]) -> onnx.ModelProto:
    """The forest as tables that all trees walk at once, one level of depth at a time.

    ONNX's tree ensemble is many times as large on disk, and takes 200 MiB and more and a third of a second to open
    (173,000 nodes); these tables are as exact. The file holds them in the smallest types that they fit into. The nodes
    before the walk do not depend on the input, and are computed once, at opening.
    """
    constants = {
        **_flatten(forest),
        "gesture_start": np.array([0], np.int64),
        "gesture_end": np.array([gestures], np.int64),
        "axis_one": np.array([1], np.int64),
        "zero": np.array([0], np.int64),
        "first_axis": np.int64(0),
        "no_step": np.int32(0),
        "one_leaf": np.int32(1),
        "whole": np.float32(WHOLE),
        "least": np.float32(LEAST_CHANCE),
        "most": np.float32(1.0 - LEAST_CHANCE),
        "one": np.float32(1.0),
        "temperature": np.float32(_temperature(calibration)),
    }
    nodes: list[onnx.NodeProto] = []

    def add(operator: str, inputs: Sequence[str], output: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(operator, list(inputs), [output], name=output, **attributes))
        return output

    whole_numbers = {"to": TensorProto.INT32}
    add("Cast", ["feature"], "feature_of", **whole_numbers)
    add("Cast", ["step"], "step_of", **whole_numbers)
    add("Equal", ["step_of", "no_step"], "is_leaf")
    add("Cast", ["is_leaf"], "leaves", **whole_numbers)
    add("CumSum", ["leaves", "first_axis"], "leaves_up_to")
    add("Sub", ["leaves_up_to", "one_leaf"], "leaf")  # a leaf's row; unused for other nodes
    add("Shape", ["features"], "shape")
    add("Gather", ["shape", "zero"], "batch")
    add("Concat", ["batch", "trees"], "walks", axis=0)
    at = add("Expand", ["root", "walks"], "at_0")  # (B, trees): the node at which each tree stands
    for level in range(max(tree.get_depth() for tree in forest.estimators_)):
        add("Gather", ["feature_of", at], f"feature_{level}")
        add("GatherElements", ["features", f"feature_{level}"], f"value_{level}", axis=1)
        add("Gather", ["threshold", at], f"threshold_{level}")
        add("Greater", [f"value_{level}", f"threshold_{level}"], f"greater_{level}")
        add("Cast", [f"greater_{level}"], f"right_{level}", **whole_numbers)
        add("Gather", ["step_of", at], f"step_{level}")
        add("Add", [at, f"step_{level}"], f"left_{level}")
        at = add("Add", [f"left_{level}", f"right_{level}"], f"at_{level + 1}")
    add("Gather", ["leaf", at], "row")
    add("Gather", ["shares", "row"], "parts")  # (B, trees, classes)
    add("Cast", ["parts"], "votes", to=TensorProto.FLOAT)
    add("ReduceMean", ["votes"], "mean_vote", axes=[1], keepdims=0)
    add("Div", ["mean_vote", "whole"], "probabilities")
    add("Slice", ["probabilities", "gesture_start", "gesture_end", "axis_one"], "named")
    add("Max", ["named", "least"], "named_least")
    add("Log", ["named_least"], "named_log")
    add("Div", ["named_log", "temperature"], "logits")
    add("Softmax", ["logits"], "scores", axis=1)
    add("ReduceSum", ["named", "axis_one"], "named_sum", keepdims=0)
    add("Sub", ["one", "named_sum"], "none_all")
    add("Clip", ["none_all", "least", "most"], "unknown")
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


def around_thresholds(forest: RandomForestClassifier, count: int) -> NDArray[np.float32]:
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
    return np.where(aside == 0, out, np.nextafter(out, np.where(aside > 0, np.inf, -np.inf).astype(np.float32)))


def rounded_down(exact: NDArray[np.float64]) -> NDArray[np.float32]:
    """Thresholds as float32, which a float32 value exceeds if and only if it exceeds the float64."""
    rounded = exact.astype(np.float32)
    return np.where(rounded > exact, np.nextafter(rounded, np.float32(-np.inf)), rounded)


def _temperature(calibration: Mapping[str, Any]) -> float:
    found = float(calibration.get("temperature", 1.0))
    if not (math.isfinite(found) and found > 0):
        raise ModelError(f"calibration: expected a temperature above 0, found {found}")
    return found


def _flatten(forest: RandomForestClassifier) -> dict[str, NDArray[Any]]:
    """All trees in one set of tables, one after the other; a right child follows its left one."""
    features, thresholds, steps, shares, roots = [], [], [], [], []
    base = 0
    for estimator in forest.estimators_:
        tree = estimator.tree_
        order = [0]  # new number -> old
        step = np.zeros(tree.node_count, np.int64)  # distance to the left child; 0 for a leaf, which leads to itself
        for new in range(tree.node_count):
            old = order[new]
            if tree.children_left[old] >= 0:
                step[new] = len(order) - new
                order += [tree.children_left[old], tree.children_right[old]]
        features.append(np.where(step == 0, 0, tree.feature[order]))
        thresholds.append(np.where(step == 0, np.float32(np.inf), rounded_down(tree.threshold[order])))
        steps.append(step)
        values = tree.value[order, 0][step == 0]
        shares.append(np.rint(values / values.sum(axis=1, keepdims=True) * WHOLE))
        roots.append(base)
        base += tree.node_count
    return {
        "feature": _smallest(np.concatenate(features)),
        "threshold": np.concatenate(thresholds).astype(np.float32),
        "step": _smallest(np.concatenate(steps)),
        "shares": np.concatenate(shares).astype(np.uint16),
        "root": np.array([roots], np.int32),
        "trees": np.array([len(roots)], np.int64),
    }


def _smallest(numbers: NDArray[np.int64]) -> NDArray[Any]:
    return numbers.astype(np.min_scalar_type(numbers.max()))


def grow_forest(
    teach: Samples, real: Samples | None, calibrate: Samples, seed: int, jobs: int
) -> tuple[RandomForestClassifier, dict[str, Any], dict[str, Any]]:
    """The touch-pattern forest of the paper's Table IV (depth 9), with a class for non-gestures.

    It has 100 trees, half of the paper's: the file is half as large, and as good on unknown people. Returns what
    `train.judged` returns: the forest, its calibration, and figures of its answers to people that it has not seen.
    """
    samples = teach if real is None else join([teach, real])
    classes = np.minimum(_classes(samples), len(GESTURES))
    # All classes weigh the same, and a real recording a fifth of a simulated one, since real ones hold only taps and
    # swipes.
    weights = np.where(np.arange(len(samples)) < len(teach), 1.0, 0.2)
    weights /= np.bincount(classes, weights)[classes]
    forest = RandomForestClassifier(100, max_depth=9, min_samples_leaf=2, n_jobs=jobs, random_state=seed)
    forest.fit(samples.features(), classes, sample_weight=weights)
    labels = np.minimum(_classes(calibrate), len(GESTURES))
    chances = forest.predict_proba(calibrate.features())
    calibration = _forest_calibration(chances, labels)
    sure = confidence(forest_outputs(chances, len(GESTURES), calibration))
    return forest, calibration, answer_figures(sure, labels < len(GESTURES), calibration["threshold"])


def _classes(samples: Samples) -> NDArray[np.int64]:
    labels = targets(samples)
    return np.where(labels < 0, len(CLASSES), labels)


def _forest_calibration(chances: NDArray[np.float64], labels: NDArray[np.int64]) -> dict[str, Any]:
    """Temperature by likelihood; threshold for at most 6 % of gestures wrong and 10 % of non-gestures accepted."""
    known = labels < len(GESTURES)
    best: tuple[float, dict[str, Any]] | None = None
    for temperature in np.geomspace(0.2, 2.0, 24):
        calibration = {"temperature": float(temperature)}
        scores, _ = forest_outputs(chances, len(GESTURES), calibration)
        loss = -float(np.log(np.maximum(scores[known, labels[known]], 1e-9)).mean())
        if best is None or loss < best[0]:
            best = loss, calibration
    assert best is not None
    calibration = best[1]
    answers = forest_outputs(chances, len(GESTURES), calibration)
    sure, wrong = confidence(answers), known & (answers[0].argmax(axis=1) != labels)
    for least in np.linspace(0.05, 0.95, 91):
        calibration["threshold"] = round(float(least), 3)
        if (wrong & (sure >= least)).sum() <= 0.06 * known.sum() and (sure[~known] >= least).mean() <= 0.1:
            break
    return calibration
