"""Gradient boosting on trajectory features as it would ship: one graph from frames to scores, its trees as tables.

All trees are walked at once, a level of depth at a time, as the daemon's forest is. The features are computed by the
code that stands in the shipped networks' graphs.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier
from torch import Tensor, nn

from gestured.lab.forest_graph import rounded_down
from gestured.lab.trajectory import trajectory_features


class Boosted(nn.Module):
    """A fitted HistGradientBoostingClassifier as tables (nodes of all trees in one row) behind the features."""

    feature: Tensor
    threshold: Tensor
    left: Tensor
    right: Tensor
    value: Tensor
    roots: Tensor
    start: Tensor

    def __init__(self, fitted: HistGradientBoostingClassifier) -> None:
        super().__init__()
        trees = [tree.nodes for round_ in fitted._predictors for tree in round_]
        self.classes = len(fitted._predictors[0])
        self.depth = max(int(nodes["depth"].max()) for nodes in trees)
        bases = np.cumsum([0, *(len(nodes) for nodes in trees)])
        for name, values in _tables(trees, bases[:-1]).items():
            self.register_buffer(name, torch.from_numpy(values))
        self.register_buffer("roots", torch.from_numpy(bases[:-1].astype(np.int64)))
        self.register_buffer("start", torch.from_numpy(np.asarray(fitted._baseline_prediction, np.float32).reshape(-1)))

    def forward(self, frames: Tensor) -> Tensor:
        """(B, T, R, C) windows -> (B, classes) probabilities."""
        return self.answer(trajectory_features(frames))

    def answer(self, features: Tensor) -> Tensor:
        """(B, F) features -> (B, classes) probabilities."""
        at = self.roots[None].expand(features.shape[0], -1)
        for _ in range(self.depth):
            beyond = features.gather(1, self.feature[at]) > self.threshold[at]
            at = torch.where(beyond, self.right[at], self.left[at])
        # Trees come round by round, and in each round one for each class.
        logits = self.value[at].reshape(features.shape[0], -1, self.classes).sum(1) + self.start
        return logits.softmax(1)


def _tables(trees: list[NDArray[Any]], bases: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
    """Nodes of all trees; a leaf leads to itself."""
    parts: dict[str, list[NDArray[Any]]] = {name: [] for name in ("feature", "threshold", "left", "right", "value")}
    for nodes, base in zip(trees, bases, strict=True):
        own, leaf = np.arange(len(nodes)) + base, nodes["is_leaf"].astype(bool)
        parts["threshold"].append(rounded_down(np.where(leaf, np.inf, nodes["num_threshold"])))
        parts["feature"].append(np.where(leaf, 0, nodes["feature_idx"]).astype(np.int64))
        parts["left"].append(np.where(leaf, own, nodes["left"].astype(np.int64) + base))
        parts["right"].append(np.where(leaf, own, nodes["right"].astype(np.int64) + base))
        parts["value"].append(nodes["value"].astype(np.float32))
    return {name: np.concatenate(values) for name, values in parts.items()}
