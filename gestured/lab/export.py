"""Export of trained networks and forests to .onnx files with metadata, and the manifest of a folder of them.

Every file is verified before it is written: ONNX's checker, everything that the daemon checks, and outputs
against the trained model's own within `PARITY`, for batches and windows of many lengths.
"""

import json
import math
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import helper
from sklearn.ensemble import RandomForestClassifier

from gestured.core.errors import ModelError
from gestured.core.window import Window
from gestured.lab.digest import file_digest
from gestured.lab.forest import OPSET, around_thresholds, forest_graph, forest_outputs
from gestured.lab.recordings import origin
from gestured.lab.written import write
from gestured.model.context import CALM, calm, chosen
from gestured.model.file import SelfTest, sealed
from gestured.model.model import Model

Outputs = tuple[NDArray[np.float32], ...]  # scores (B, G), unknown (B,), perhaps an embedding (B, E)

PARITY = 1e-4  # of a probability, and of an embedding's largest value
BATCHES = (1, 2, 7)
CHECKED_LENGTHS = (1, 2, 15, 60, 500)  # frames


@dataclass(frozen=True)
class Facts:
    """The metadata of a model's file, of whatever kind."""

    kind: str
    version: str
    gestures: Sequence[str]
    window: Window
    calibration: Mapping[str, Any]
    training_data: str  # sha256
    quantiles: Mapping[str, Any]
    classes: Sequence[str] | None = None  # all that the nets tell apart, gestures first
    context: Sequence[str] | None = None  # names of the context that the graph takes as its second input
    operating_points: Mapping[str, Any] | None = None  # thresholds by strictness, and what they cost
    provisional: Mapping[str, Any] | None = None  # the rule for provisional events (`early`)
    learned_from: Sequence[Mapping[str, Any]] | None = None  # `origins`; None if it is not known

    def metadata(self) -> dict[str, str]:
        """The metadata as strings, by key."""
        told = (origin.KEY, "classes", "context", "operating_points", "provisional")
        more: dict[str, Any] = {name: getattr(self, name) for name in told}
        known = {key: json.dumps(value, allow_nan=False) for key, value in more.items() if value is not None}
        return known | {
            "gestures": json.dumps(list(self.gestures)),
            "kind": self.kind,
            "version": self.version,
            "rows": str(self.window.rows),
            "columns": str(self.window.columns),
            "rate_hz": repr(self.window.rate_hz),
            "window": self.window.to_json(),
            "calibration": json.dumps(dict(self.calibration), allow_nan=False),
            "training_data": self.training_data,
            "quantiles": json.dumps(dict(self.quantiles), allow_nan=False),
        }


def export_net(module: torch.nn.Module, path: Path, facts: Facts) -> None:
    """Write a torch module whose `forward` takes frames (B, T, R, C) and gives calibrated outputs.

    `forward` returns (scores (B, G), unknown (B,)), and perhaps an embedding (B, E). B and T stay open. Raises
    ModelError if the file's outputs differ from torch's by more than `PARITY`, or a check fails.
    """
    module = module.eval()
    rows, columns = facts.window.rows, facts.window.columns
    takes = ["frames"] if facts.context is None else ["frames", "context"]

    def given(frames: NDArray[np.float32], beside: NDArray[np.float32] | None) -> tuple[torch.Tensor, ...]:
        around = calm(len(frames), facts.context or ()) if beside is None else beside
        return tuple(torch.from_numpy(array) for array in (frames, around)[: len(takes)])

    def truth(frames: NDArray[np.float32], beside: NDArray[np.float32] | None = None) -> Outputs:
        with torch.no_grad():
            return tuple(output.numpy() for output in module(*given(frames, beside)))

    example = np.round(_windows(2, 12, rows, columns), 3)
    names = ["scores", "unknown", "embedding"][: len(truth(example))]
    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as directory:
        traced = Path(directory) / "traced.onnx"
        # The tracer warns of whatever could be frozen into the graph; `_compare` finds what is.
        warnings.simplefilter("ignore")
        # Not with dynamo, whose second export of an LSTM in a process silently fixes T (torch 2.13). The example has a
        # batch of 2, so that no dimension is taken for a constant 1.
        torch.onnx.export(
            module,
            given(_windows(2, 5, rows, columns), None),
            traced,
            dynamo=False,
            opset_version=OPSET,
            input_names=takes,
            output_names=names,
            dynamic_axes={"frames": {0: "B", 1: "T"}} | {name: {0: "B"} for name in (*takes[1:], *names)},
        )
        proto = onnx.load(traced)
    inputs = [_windows(b, t, rows, columns) for b in BATCHES for t in CHECKED_LENGTHS]
    _finish(proto, path, facts.metadata(), example, truth, inputs)


def export_forest(forest: RandomForestClassifier, path: Path, facts: Facts, features: Sequence[str]) -> None:
    """Write a random forest over `features`; its classes are 0 .. G-1 for the gestures, the others for none.

    The outputs are those of `forest_outputs`. Raises ModelError if the file's differ from the forest's own by more than
    `PARITY`, or a check fails.
    """
    count = len(facts.gestures)
    if not np.array_equal(forest.classes_, np.arange(len(forest.classes_))) or len(forest.classes_) < count:
        raise ModelError(f"{path}: the forest's classes are {forest.classes_}, expected 0, 1 ... {count - 1} first")
    if forest.n_features_in_ != len(features):
        raise ModelError(f"{path}: the forest takes {forest.n_features_in_} features, expected {len(features)}")

    def truth(values: NDArray[np.float32]) -> Outputs:
        return forest_outputs(forest.predict_proba(values), count, facts.calibration)

    sample = around_thresholds(forest, 508)
    metadata = facts.metadata() | {"features": json.dumps(list(features))}
    inputs = [sample[start : start + size] for start, size in ((0, 1), (1, 2), (3, 5), (8, 500))]
    _finish(forest_graph(forest, count, facts.calibration), path, metadata, sample[:4], truth, inputs)


def _finish(
    proto: onnx.ModelProto,
    path: Path,
    metadata: dict[str, str],
    example: NDArray[np.float32],
    truth: Callable[[NDArray[np.float32]], Outputs],
    inputs: Sequence[NDArray[np.float32]],
) -> None:
    """Put metadata and self-test into the model, check everything, and write the file at once."""
    proto.producer_name, proto.producer_version, proto.doc_string = "gestured", metadata["version"], ""
    proto.graph.name, proto.graph.doc_string = metadata["kind"], ""
    for node in proto.graph.node:
        node.doc_string = ""  # may hold paths of the machine that trained it
    scores, unknown = truth(example)[:2]
    helper.set_model_props(proto, metadata | {"self_test": SelfTest(example, scores, unknown).to_json()})
    try:
        onnx.checker.check_model(proto, full_check=True)
        data = sealed(proto.SerializeToString(deterministic=True))
        _compare(Model(data, path.stem), truth, inputs)
    except (ValueError, onnx.checker.ValidationError, onnx.shape_inference.InferenceError) as error:
        raise ModelError(f"{path}: not written: {error}") from error
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path, data)


def _compare(
    model: Model, truth: Callable[[NDArray[np.float32]], Outputs], inputs: Sequence[NDArray[np.float32]]
) -> None:
    """Raises ValueError if file and trained model answer differently, or a batch and its members."""

    def outputs(batch: NDArray[np.float32]) -> Outputs:
        return (*model.run(batch), model.embed(batch)) if model.embeds else model.run(batch)

    if model.metadata.context is not None:
        _compare_beside(model, truth, inputs)
    for batch in inputs:
        found, expected = outputs(batch), truth(batch)
        alone = [outputs(batch[k : k + 1]) for k in range(min(len(batch), 7))]
        for one, other in (
            *zip(found, expected, strict=True),
            *((found[n][: len(alone)], np.concatenate([a[n] for a in alone])) for n in range(len(found))),
        ):
            difference = math.inf
            if one.shape == other.shape:  # an embedding may have values of tens
                difference = float(np.abs(one - other).max() / max(np.abs(other).max(), 1.0))
            if not difference <= PARITY:
                raise ValueError(
                    f"outputs differ by {difference:.3g} from the trained model's, or a batch's from its "
                    f"members', for an input of shape {batch.shape}; expected {PARITY} at most"
                )


def _compare_beside(model: Model, truth: Callable[..., Outputs], inputs: Sequence[NDArray[np.float32]]) -> None:
    """Raises ValueError if file and trained model answer differently to the context of a segment."""
    rng = np.random.default_rng(0)
    for batch in inputs:
        beside = np.tile(CALM, (len(batch), 1)) + rng.normal(0.0, 1.0, (len(batch), len(CALM))).astype(np.float32)
        found, expected = model.run(batch, beside=beside), truth(batch, beside[:, chosen(model.metadata.context or ())])
        if not max(float(np.abs(a - b).max()) for a, b in zip(found, expected, strict=False)) <= PARITY:
            raise ValueError(f"outputs differ from the trained model's in other surroundings by more than {PARITY}")


def _windows(batch: int, length: int, rows: int, columns: int) -> NDArray[np.float32]:
    """(B, T, R, C) windows, the same on every call: moving blobs, faint noise, quiet frames at the end.

    Of more than four, one is all quiet and one all noise: no recording gives these, but a net must bear them.
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


NAME = "manifest.json"


def measured(model: Path) -> dict[str, Any]:
    """The figures of a model file in the manifest beside it; empty if the manifest has another file of this name.

    Raises ModelError if the manifest is none.
    """
    manifest = model.with_name(NAME)
    try:
        entry = json.loads(manifest.read_text())["models"].get(model.name, {}) if manifest.exists() else {}
        figures: dict[str, Any] = entry.get("figures", {})
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise ModelError(f"{manifest}: expected what gestured-lab evaluate writes: {error!r}") from error
    return figures if entry.get("sha256") == file_digest(model) else {}


def write_manifest(directory: Path, figures: Mapping[str, Any]) -> None:
    """Write `manifest.json` for the directory's .onnx files.

    `figures` holds what was measured of each, by file name without suffix. Raises ModelError for a file that
    is no model.
    """
    models = {}
    for path in sorted(directory.glob("*.onnx")):
        data = path.read_bytes()
        try:
            model = Model(data, path.stem)
        except ValueError as error:
            raise ModelError(f"{path}: {error}") from error
        models[path.name] = {
            "sha256": model.sha256,
            "size": model.size,
            "kind": model.metadata.kind,
            "version": model.metadata.version,
            "gestures": list(model.gestures),
            "figures": figures.get(path.stem, {}),
        }
    write(directory / NAME, json.dumps({"models": plain(models)}, indent=2, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """A JSON value with null for each number that is not finite, since JSON has no NaN."""
    if isinstance(value, Mapping):
        return {key: plain(of) for key, of in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
