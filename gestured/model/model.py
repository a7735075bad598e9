"""A model: an .onnx file, found, verified, self-tested and opened as a classifier.

A file is read once, checked against the manifest (where it is a shipped one) or opened in a process of its own
first (where it is not: `process`), inspected without onnxruntime, opened from those bytes, held against its own
metadata and made to reproduce its self-test. Whatever is wrong is one `ModelError`: the file, what is wrong, what was
expected.
"""

import hashlib
import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.classifier import Scores
from gestured.core.errors import ModelError
from gestured.core.features import touch_pattern
from gestured.core.frames import Segment
from gestured.model.file import inspect, read_bytes
from gestured.model.metadata import Metadata
from gestured.model.process import ModelProcess, try_out
from gestured.model.session import Session

LADDER = ("cnn_lstm", "lstm", "touch_pattern_rf")  # the shipped models, best first
TOLERANCE = 1e-3  # of the self-test: other processors round differently, another model is further off
ROUNDING = 1e-4  # by which a probability may lie outside of 0 to 1
SUM_ROUNDING = 1e-3  # by which probabilities may miss 1 together
RUN_S = 1.5  # for one segment; it takes some milliseconds
SELF_TEST_S = 10.0  # for the self-test's few segments, on a machine that is busy starting
BATCH_S = 3600.0  # for any number of segments at once


class Model:
    """A model that has passed every check; implements `Classifier`."""

    def __init__(self, data: bytes, name: str) -> None:
        """Opens `data`; `name` stands for it in events. ValueError says what is wrong."""
        self.name = name
        self.size = len(data)
        self.sha256 = hashlib.sha256(data).hexdigest()
        self.metadata = Metadata.parse(inspect(data))
        self.gestures = self.metadata.gestures
        self.rows = self.metadata.rows
        self.columns = self.metadata.columns
        self.threshold = self.metadata.threshold
        self.certainty = self.metadata.provisional
        self._session = Session(data)
        self._input = self._session.check(self.metadata)
        self.embeds = "embedding" in self._session.outputs
        self.space = self.metadata.own if self.embeds else None
        self.self_test_error = self._self_test()

    def classify(self, segment: Segment) -> Scores:
        """Scores of one segment. What is empty or not finite is unknown, whatever a net would say of it.

        Raises ModelError where the model fails or does not give probabilities.
        """
        with np.errstate(all="ignore"):  # counts near the limits of float32 overflow; checked below
            window = self.metadata.window.apply(segment)
            usable = len(window) > 0 and all(np.isfinite(a).all() for a in (segment.frames, window))
            if usable and self._input == "features":
                window = touch_pattern(window, self.metadata.rate_hz)
                usable = bool(np.isfinite(window).all())
        if not usable:
            count = len(self.gestures)
            return Scores(np.full(count, 1.0 / count, np.float32), 1.0, self.name)
        try:
            scores, unknown = self.run(window[np.newaxis], RUN_S)
        except ValueError as error:
            raise ModelError(f"{self.name}: {error}") from error
        return Scores(scores[0], float(unknown[0]), self.name, threshold=self.threshold)

    def preview(self, segment: Segment) -> Scores | None:
        """Scores of the beginning of a segment, None where that fails."""
        try:
            return self.classify(segment)
        except ModelError:
            return None

    def run(
        self, batch: NDArray[np.float32], limit_s: float = BATCH_S
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(B, T, R, C) windows or (B, F) features -> scores (B, G), unknown (B,).

        ValueError where the model fails, takes longer than `limit_s`, or what it gives are no probabilities.
        """
        scores, unknown = self._session.run(("scores", "unknown"), {self._input: batch}, limit_s)
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

    def embed(self, batch: NDArray[np.float32], limit_s: float = BATCH_S) -> NDArray[np.float32]:
        """(B, T, R, C) windows -> (B, E) embedding, of a model that has one (`embeds`). ValueError as for `run`."""
        (embedding,) = self._session.run(("embedding",), {self._input: batch}, limit_s)
        if embedding.ndim != 2 or len(embedding) != len(batch) or not np.isfinite(embedding).all():
            raise ValueError(f"embedding has the shape {embedding.shape}, expected ({len(batch)}, E), all finite")
        return embedding

    def report(self) -> dict[str, Any]:
        """What is known of it, as JSON values."""
        known = self.metadata
        return {
            "kind": known.kind,
            "version": known.version,
            "size": self.size,
            "sha256": self.sha256,
            "input": self._input,
            "gestures": list(self.gestures),
            "window": asdict(known.window),
            "calibration": dict(known.calibration),
            "provisional": known.provisional is not None,
            "training_data": known.training_data,
            "self_test": {"largest_difference": self.self_test_error, "tolerance": TOLERANCE},
        }

    def _self_test(self) -> float:
        """The largest difference from the stored outputs; ValueError where it is above `TOLERANCE`."""
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


def shipped() -> dict[str, Path]:
    """The models that come with the package, best first: name -> where its file belongs."""
    return {name: _shipped_directory() / f"{name}.onnx" for name in LADDER}


def _shipped_directory() -> Path:
    """Beside the package, installed or in a checkout."""
    return Path(__file__).resolve().parents[2] / "gestured_models"


def shipped_name(source: str | Path) -> str | None:
    """The shipped model's name where `source` is one, by path or by name."""
    try:
        return _locate(source)[1]
    except ModelError:
        return None  # opening it says why


def _locate(source: str | Path) -> tuple[Path, str | None]:
    """(path, the shipped model's name where it is one).

    A text without a slash is a shipped model's name. With `.onnx` at its end it is a file, too, where there is one.
    """
    path = Path(source)
    known = shipped()
    if isinstance(source, str) and os.sep not in source and not (path.suffix == ".onnx" and os.path.lexists(source)):
        name = source.removesuffix(".onnx")
        if name not in known:
            missing = "no such file, and " if path.suffix == ".onnx" else ""
            raise ModelError(
                f"{source}: {missing}no shipped model (these are {', '.join(known)}); "
                f"a file of another name is given with its folder, as ./{source}"
            )
        return known[name], name
    try:
        if path.resolve() == known[path.stem].resolve():
            return path, path.stem
    except (KeyError, OSError, ValueError, RuntimeError):
        pass  # not one of them, or no path at all: reading says it
    return path, None


def _read(source: str | Path) -> tuple[Path, str | None, bytes]:
    """As `_locate`, and the file's bytes; a shipped file's are those that its manifest knows."""
    path, name = _locate(source)
    try:
        data = read_bytes(path)
        if name is not None:
            expected = _manifest_sha256(path)
            if hashlib.sha256(data).hexdigest() != expected:
                raise ValueError(f"is not the shipped file: expected the sha256 {expected} of manifest.json")
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from error
    return path, name, data


def _manifest_sha256(path: Path) -> str:
    try:
        manifest = json.loads((path.parent / "manifest.json").read_text())
        return str(manifest["models"][path.name]["sha256"])
    except (OSError, ValueError, KeyError, TypeError):
        raise ValueError("is a shipped model, expected its sha256 in the manifest.json beside it") from None


def open_model(source: str | Path, tried: str | None = None) -> Model:
    """Open and verify a model: a path, or the bare name of a shipped one. Raises ModelError.

    What does not ship is tried in a process of its own first, which takes about half a second, at most some seconds;
    not where its sha256 is that of a file that was `tried` before.
    """
    path, name, data = _read(source)
    try:
        if name is None and tried is None:
            try_out(data)
        elif name is None and hashlib.sha256(data).hexdigest() != tried:
            raise ValueError("is not the file that was tried any more; a reload takes the new one")
        return Model(data, path.stem)
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from error


def look_at(source: str | Path) -> tuple[tuple[str, ...], str]:
    """(gestures, sha256) of a model that `open_model` will open at once, because it ships or was tried here.

    Raises ModelError.
    """
    path, name, data = _read(source)
    try:
        if name is None:
            report = try_out(data)
            return tuple(report["gestures"]), report["sha256"]
        return Metadata.parse(inspect(data)).gestures, hashlib.sha256(data).hexdigest()
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from error


def open_apart(source: str | Path) -> ModelProcess:
    """Open and verify a model in a process of its own, and leave it there. Raises ModelError."""
    path, _, data = _read(source)
    try:
        return ModelProcess(data, path.stem)
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from error


def check(source: str | Path) -> dict[str, Any]:
    """What `gesturectl check` reports of a good model, as JSON values; raises ModelError for any other."""
    path, name, data = _read(source)
    try:
        report = try_out(data) if name is None else Model(data, path.stem).report()
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from error
    first = {key: report[key] for key in ("kind", "version")}
    return {"file": str(path), "name": path.stem, **first, "shipped": name is not None} | report
