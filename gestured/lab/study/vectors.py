"""A support vector machine with a Gaussian kernel whose kernel matrix is made by one matrix product.

scikit-learn's own goes through all features for each pair of samples, and takes minutes where there are many features.
Its solver gets the finished matrix here; what it finds is the same.
"""

from typing import Self

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.metrics.pairwise import rbf_kernel
from sklearn.svm import SVC


class VectorMachine(ClassifierMixin, BaseEstimator):  # type: ignore[misc, unused-ignore]
    """scikit-learn's SVC(kernel="rbf") by a finished kernel matrix, of which the support vectors are kept."""

    def __init__(self, cost: float = 1.0, gamma: float = 1.0) -> None:
        self.cost, self.gamma = cost, gamma

    def fit(self, inputs: NDArray[np.floating], labels: NDArray[np.integer]) -> Self:
        """Learn from samples (n, F) and their classes (n,)."""
        machine = SVC(C=self.cost, kernel="precomputed").fit(rbf_kernel(inputs, gamma=self.gamma), labels)
        self.classes_, self._machine = machine.classes_, machine
        self._support, self._count = np.asarray(inputs, np.float32)[machine.support_], len(inputs)
        return self

    def decision_function(self, inputs: NDArray[np.floating]) -> NDArray[np.float64]:
        """(n, classes) values, the largest of which names the class."""
        return np.asarray(self._machine.decision_function(self._kernel(inputs)))

    def predict(self, inputs: NDArray[np.floating]) -> NDArray[np.integer]:
        """(n,) classes, the best one of each input."""
        return np.asarray(self._machine.predict(self._kernel(inputs)))

    def _kernel(self, inputs: NDArray[np.floating]) -> NDArray[np.float64]:
        """(n, all that was learned from): the solver looks at the columns of the support vectors alone."""
        out = np.zeros((len(inputs), self._count))
        out[:, self._machine.support_] = rbf_kernel(inputs, self._support, gamma=self.gamma)
        return out
