"""`manifest.json`: what each model file of a folder is, and what was measured of it."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gestured.core.errors import ModelError
from gestured.lab.digest import file_digest
from gestured.model.model import Model
from gestured.record.files import PUBLIC, atomic_write

NAME = "manifest.json"


def measured(model: Path) -> dict[str, Any]:
    """What the manifest beside a model file holds of figures of this very file; empty where it knows another one."""
    manifest = model.with_name(NAME)
    entry = json.loads(manifest.read_text())["models"].get(model.name, {}) if manifest.exists() else {}
    figures: dict[str, Any] = entry.get("figures", {})
    return figures if entry.get("sha256") == file_digest(model) else {}


def write_manifest(directory: Path, figures: Mapping[str, Any]) -> None:
    """Write `manifest.json` over the directory's .onnx files.

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
    with atomic_write(directory / NAME, PUBLIC) as file:
        file.write((json.dumps({"models": _plain(models)}, indent=2, allow_nan=False) + "\n").encode())


def _plain(value: Any) -> Any:
    """The same with null for what is not a finite number: JSON has no NaN."""
    if isinstance(value, Mapping):
        return {key: _plain(of) for key, of in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
