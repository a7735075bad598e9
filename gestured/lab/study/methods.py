"""The registry: every method, its hyperparameters, and the paper's figures for it.

Hyperparameters `paper` are those of the paper's Table IV (it has one column for plain and one for augmented data); for
the networks the paper gives the layers and the LSTM's width, the rest is ours. The best of `grid` is the tuned setting.
Feature vectors are standardised over the training set before KNN and SVM, which the paper leaves open.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import ClassifierMixin
from sklearn.ensemble import HistGradientBoostingClassifier, RandomForestClassifier
from sklearn.metrics.pairwise import rbf_kernel
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC
from torch import nn

from gestured.lab.study import views
from gestured.lab.study.training import HistoryNet, Indices, Inputs, Net, SequenceNet, train_net
from gestured.lab.study.views import Values, View


@dataclass(frozen=True)
class Estimator:
    """A fitted scikit-learn classifier."""

    fitted: ClassifierMixin
    classes: int

    def scores(self, inputs: NDArray[np.float32], index: Indices) -> NDArray[np.float64]:
        """(n, K) probabilities, or an SVM's decision values; the least of all for a class that was not learned."""
        ask = getattr(self.fitted, "predict_proba", None) or self.fitted.decision_function
        out = np.full((len(index), self.classes), -np.inf)
        out[:, self.fitted.classes_] = ask(inputs[index])
        return out


def _nearest(values: Values, seed: int) -> ClassifierMixin:
    return make_pipeline(StandardScaler(), KNeighborsClassifier(values["neighbours"]))


def _forest(values: Values, seed: int) -> ClassifierMixin:
    return RandomForestClassifier(values["trees"], max_depth=values["depth"], random_state=seed)


def _vectors(values: Values, seed: int) -> ClassifierMixin:
    # One matrix product makes the kernel: libsvm's own takes minutes if there are many features.
    kernel = partial(rbf_kernel, gamma=2.0 ** values["log2_gamma"])
    return make_pipeline(StandardScaler(), SVC(C=2.0 ** values["log2_c"], kernel=kernel))


def _boosting(values: Values, seed: int) -> ClassifierMixin:
    return HistGradientBoostingClassifier(
        max_iter=values["rounds"], learning_rate=values["rate"], max_leaf_nodes=values["leaves"],
        l2_regularization=1.0, early_stopping=False, random_state=seed,
    )  # fmt: skip


def _estimate(
    build: Callable[[Values, int], ClassifierMixin],
    inputs: NDArray[np.float32], index: Indices, labels: Indices, classes: int, values: Values, seed: int,
) -> Estimator:  # fmt: skip
    return Estimator(build(values, seed).fit(inputs[index], labels[index]), classes)


# Fits a model: inputs, the chosen ones, labels, the number of classes, hyperparameters and a seed -> the model.
Fit = Callable[[Any, Indices, Indices, int, Values, int], Estimator | Net]


@dataclass(frozen=True)
class Method:
    """A way to tell gestures apart."""

    id: str
    title: str
    view: View
    fit: Fit
    grid: tuple[Values, ...]  # candidates for tuning, whole sets of hyperparameters
    paper: Mapping[str, Values] | None  # by augmentation; None beyond the paper
    published: Mapping[str, float]  # the paper's share right, by augmentation
    published_online: float | None = None

    @property
    def network(self) -> bool:
        """Whether the method is a network, which is trained in batches."""
        return "steps" in self.grid[0]


KINDS = {
    "knn": ("k nearest neighbours", _nearest, [{"neighbours": k} for k in (1, 4, 7, 15)]),
    "rf": ("random forest", _forest, [{"trees": 200, "depth": d} for d in (9, 14, 20)]),
    "svm": ("support vector machine (RBF)", _vectors,
            [{"log2_c": c, "log2_gamma": g} for c in (3, 7, 11) for g in (-11, -8, -5)]),
}  # fmt: skip
FOREST = {"trees": 200, "depth": 9}


def _classical(
    prefix: str, family: str, view: View, given: Values,
    variants: tuple[Values, ...], settings: Mapping[str, tuple[Values, Values]],
    published: Mapping[str, tuple[float, float]],
) -> Iterator[Method]:  # fmt: skip
    """KNN, forest and SVM on one set of features."""
    for kind, (title, build, grid) in KINDS.items():
        plain, augmented = settings[kind]
        yield Method(
            f"{prefix}_{kind}", f"{family}, {title}", view, partial(_estimate, build),
            tuple({**v, **g} for v in variants for g in grid),
            {"none": {**given, **plain}, "shift": {**given, **augmented}},
            dict(zip(("none", "shift"), published[kind], strict=True)),
            published_online=0.71 if (prefix, kind) == ("tp", "rf") else None,
        )  # fmt: skip


HAAR = {"wavelet": views.WAVELET, "level": views.WAVELET_LEVEL, "reading": views.TAXELS}
TRAINING_STEPS = 800  # batches


def _net(
    kind: str, title: str, rates: tuple[float, ...], widths: tuple[int, ...],
    published: tuple[float, float, float] | None,
) -> Method:  # fmt: skip
    channels = {"channels": 8} if kind.startswith("cnn_") else {}
    grid = [{"units": u, "rate": r, "steps": TRAINING_STEPS, **channels} for u in widths for r in rates]
    given = {"units": 32, "rate": rates[0], "steps": TRAINING_STEPS, **channels}

    def make(classes: int, values: Values) -> nn.Module:
        return SequenceNet(kind, values["units"], classes, values.get("channels", 0))

    return Method(
        kind, title, views.FRAMES, partial(_train, make), tuple(grid),
        dict.fromkeys(("none", "shift"), given) if published else None,
        {"none": published[0], "shift": published[1]} if published else {},
        published_online=published[2] if published else None,
    )  # fmt: skip


def _train(
    make: Callable[[int, Values], nn.Module],
    inputs: Inputs, index: Indices, labels: Indices, classes: int, values: Values, seed: int,
) -> Net:  # fmt: skip
    return train_net(partial(make, classes, values), inputs, index, labels, values["steps"], values["rate"], seed)


HISTORY_GRID = [
    {"decay_s": 0.0, "channels": c, "rate": r, "steps": TRAINING_STEPS} for c, r in ((8, 4e-3), (16, 2e-3), (16, 4e-3))
]
BOOSTING_GRID = tuple({"rounds": n, "rate": r, "leaves": 15} for n, r in ((40, 0.2), (80, 0.1)))

METHODS: dict[str, Method] = {
    method.id: method
    for method in [
        *_classical(
            "st", "spatio-temporal features", views.WAVELETS, HAAR, (HAAR,),
            {
                "knn": ({"neighbours": 7}, {"neighbours": 7}),
                "rf": (FOREST, FOREST),
                "svm": ({"log2_c": 7, "log2_gamma": -11}, {"log2_c": 9, "log2_gamma": -13}),
            },
            {"knn": (0.62, 0.79), "rf": (0.58, 0.96), "svm": (0.58, 0.98)},
        ),
        *_classical(
            "tp", "touch-pattern features", views.TOUCHES, {"features": "paper"},
            ({"features": "paper"}, {"features": "daemon"}),
            {
                "knn": ({"neighbours": 4}, {"neighbours": 1}),
                "rf": (FOREST, FOREST),
                "svm": ({"log2_c": 13, "log2_gamma": -13}, {"log2_c": 9, "log2_gamma": -7}),
            },
            {"knn": (0.56, 0.98), "rf": (0.60, 0.98), "svm": (0.56, 0.97)},
        ),
        Method(
            "mhi_cnn", "CNN on motion history images", views.HISTORY,
            partial(_train, lambda classes, values: HistoryNet(classes, values["channels"])),
            tuple(HISTORY_GRID), dict.fromkeys(("none", "shift"), HISTORY_GRID[2]),
            {"none": 0.77, "shift": 0.81},
        ),
        _net("lstm", "LSTM", (8e-3, 4e-3), (32, 64), (0.82, 0.97, 0.89)),
        _net("cnn_lstm", "CNN-LSTM", (8e-3, 4e-3), (32,), (0.89, 0.97, 0.93)),
        _net("cnn_gru", "CNN-GRU", (8e-3, 4e-3), (32,), None),
        Method(
            "trajectory_gb", "trajectory features, gradient boosting", views.TRAJECTORIES,
            partial(_estimate, _boosting), BOOSTING_GRID, None, {},
        ),
    ]
}  # fmt: skip
