"""A model: the bytes of an .onnx file, verified, self-tested and opened as a classifier.

The bytes are compared with their digest and opened; the graph must fit its metadata and reproduce its self-test.
"""

import hashlib
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.classifier import Scores
from gestured.core.errors import ModelError
from gestured.core.frames import Segment
from gestured.model.context import calm, chosen, context
from gestured.model.features import touch_pattern
from gestured.model.file import check_alone, has_digest
from gestured.model.metadata import Metadata
from gestured.model.session import Session

TOLERANCE = 1e-3  # outputs may differ by so much from the self-test's, since other processors round differently
ROUNDING = 1e-4  # a probability may lie by so much outside of 0 to 1
SUM_ROUNDING = 1e-3  # the sum of probabilities may differ by so much from 1
RUN_S = 1.5  # the longest run on one segment; some milliseconds are usual
SELF_TEST_S = 10.0  # the longest run on the self-test's few segments, as the machine may be busy starting
BATCH_S = 3600.0  # the longest run on any number of segments at once


class Model:
    """A model that has passed every check; implements `Classifier`."""

    def __init__(self, data: bytes, name: str) -> None:
        """Open the bytes of a file; `name` is the model's name in events. Raises ValueError if anything is wrong."""
        self.name = name
        self.size = len(data)
        self.sha256 = hashlib.sha256(data).hexdigest()
        self.sealed = has_digest(data)  # whether it ends in its digest; else only the self-test can find damage
        check_alone(data)
        self._session = Session(data)
        self.properties = self._session.properties()
        self.metadata = Metadata.parse(self.properties, sealed=self.sealed)
        self.gestures = self.metadata.gestures
        self.rows = self.metadata.window.rows
        self.columns = self.metadata.window.columns
        self.threshold = self.metadata.threshold
        self.points = self.metadata.points
        self.certainty = self.metadata.provisional
        self._input = self._session.check(self.metadata)
        self._beside = chosen(self.metadata.context or ())
        self.embeds = "embedding" in self._session.outputs
        self.space = self.metadata.own if self.embeds else None
        self.self_test_error = self._self_test()

    def classify(self, segment: Segment) -> Scores:
        """The scores of one segment. A segment that is empty or not finite is unknown, whatever a net would say.

        Raises ModelError if the model fails or does not give probabilities.
        """
        with np.errstate(all="ignore"):  # counts near the limits of float32 overflow; checked below
            signed = self.metadata.window.signed(segment)
            window = np.maximum(signed, np.float32(0.0))
            usable = len(window) > 0 and all(np.isfinite(a).all() for a in (segment.frames, signed))
            beside = context(segment, signed, self.metadata.window) if usable and self._beside else None
            if usable and self._input == "features":
                window = touch_pattern(window, self.metadata.window.rate_hz)
                usable = bool(np.isfinite(window).all())
        if not usable:
            count = len(self.gestures)
            return Scores(np.full(count, 1.0 / count, np.float32), 1.0, self.name)
        try:
            told = None if beside is None else beside[np.newaxis]
            scores, unknown = self.run(window[np.newaxis], RUN_S, told)
        except ValueError as error:
            raise ModelError(f"{self.name}: {error}") from error
        return Scores(scores[0], float(unknown[0]), self.name, threshold=self.threshold, points=self.points)

    def preview(self, segment: Segment) -> Scores | None:
        """What `classify` gives, None if that fails."""
        try:
            return self.classify(segment)
        except ModelError:
            return None

    def run(
        self, batch: NDArray[np.float32], limit_s: float = BATCH_S, beside: NDArray[np.float32] | None = None
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(B, T, R, C) windows or (B, F) features -> scores (B, G), unknown (B,).

        `beside` is their (B, K) context, the values of `context.NAMES`; without it they count as clear gestures on an
        undisturbed sensor. Raises ValueError if the model fails, exceeds `limit_s`, or gives no probabilities.
        """
        scores, unknown = self._session.run(("scores", "unknown"), self._inputs(batch, beside), limit_s)
        expected = (len(batch), len(self.gestures))
        if scores.shape != expected or unknown.shape != expected[:1]:
            found = f"{scores.shape} and {unknown.shape}"
            raise ValueError(f"outputs have the shapes {found}, expected {expected} and {expected[:1]}")
        both = np.concatenate([scores, unknown[:, np.newaxis]], axis=1)
        sums = scores.sum(axis=1)
        # Written so that NaN fails every comparison.
        if not (both.min() >= -ROUNDING and both.max() <= 1.0 + ROUNDING and np.abs(sums - 1.0).max() <= SUM_ROUNDING):
            raise ValueError("outputs are not probabilities: expected 0 to 1, scores that add up to 1")
        return np.clip(scores, 0.0, 1.0), np.clip(unknown, 0.0, 1.0)

    def _inputs(self, batch: NDArray[np.float32], beside: NDArray[np.float32] | None) -> dict[str, NDArray[np.float32]]:
        names = self.metadata.context
        if names is None:
            return {self._input: batch}
        told = calm(len(batch), names) if beside is None else beside[:, self._beside]
        return {self._input: batch, "context": told}

    def embed(self, batch: NDArray[np.float32], limit_s: float = BATCH_S) -> NDArray[np.float32]:
        """(B, T, R, C) windows -> (B, E) embeddings, by a model that `embeds`. Raises ValueError as `run` does."""
        (embedding,) = self._session.run(("embedding",), self._inputs(batch, None), limit_s)
        if embedding.ndim != 2 or len(embedding) != len(batch) or not np.isfinite(embedding).all():
            raise ValueError(f"embedding has the shape {embedding.shape}, expected ({len(batch)}, E), all finite")
        return embedding

    def report(self) -> dict[str, Any]:
        """What is known of the model, as JSON values."""
        known = self.metadata
        return {
            "kind": known.kind,
            "version": known.version,
            "size": self.size,
            "sha256": self.sha256,
            "digest": self.sealed,
            "input": self._input,
            "gestures": list(self.gestures),
            "window": asdict(known.window),
            "calibration": dict(known.calibration),
            "provisional": known.provisional is not None,
            "operating_points": known.points and {name: asdict(point) for name, point in known.points.items()},
            "training_data": known.training_data,
            "self_test": {"largest_difference": self.self_test_error, "tolerance": TOLERANCE},
        }

    def _self_test(self) -> float:
        """The largest difference from the stored outputs. Raises ValueError if it is above `TOLERANCE`."""
        test = self.metadata.self_test
        expected = (len(test.values), len(self.gestures))
        rank = 4 if self._input == "frames" else 2
        if test.values.ndim != rank or test.scores.shape != expected:
            raise ValueError(f"self-test: expected scores {expected} of a {rank}-dimensional input")
        try:
            scores, unknown = self.run(test.values, SELF_TEST_S)
        except ValueError as error:
            raise ValueError(f"self-test: {error}") from error
        difference = float(max(np.abs(scores - test.scores).max(), np.abs(unknown - test.unknown).max()))
        if not difference <= TOLERANCE:
            raise ValueError(f"self-test: {difference:.3g} from the stored outputs, expected {TOLERANCE} at most")
        return difference
