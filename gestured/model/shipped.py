"""The files of models and their bytes: at a path, or beside the package under a shipped model's name.

Whatever is wrong is a `ModelError`, which names the file, what is wrong and what was expected.
"""

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gestured.core.errors import ModelError
from gestured.model.file import read_bytes

LADDER = ("cnn_lstm", "lstm", "touch_pattern_rf")  # the shipped models, best first


def shipped() -> dict[str, Path]:
    """The models that come with the package, best first: by name, the path at which the file belongs."""
    return {name: _shipped_directory() / f"{name}.onnx" for name in LADDER}


def _shipped_directory() -> Path:
    """The folder of the shipped models, beside the package, installed or in a checkout."""
    return Path(__file__).resolve().parents[2] / "gestured_models"


def shipped_name(source: str | Path) -> str | None:
    """The shipped model's name if `source` is one, by path or by name; else None."""
    try:
        return _locate(source)[1]
    except ModelError:
        return None  # the error is raised when the model is opened


def _locate(source: str | Path) -> tuple[Path, str | None]:
    """(path, the shipped model's name if it is one, else None).

    A text without a slash is a shipped model's name, unless it ends in `.onnx` and there is such a file.
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
        pass  # no shipped model, or no path at all, which `read` reports
    return path, None


def read(source: str | Path) -> tuple[Path, str | None, bytes, str]:
    """(path, the shipped model's name if it is one, its bytes, their sha256).

    A shipped file must have the sha256 of the manifest. Raises ModelError.
    """
    path, name = _locate(source)
    with naming(path):
        data = read_bytes(path)
        sha256 = hashlib.sha256(data).hexdigest()
        if name is not None and sha256 != (expected := _manifest(path, "sha256")):
            raise ValueError(f"is not the shipped file: expected the sha256 {expected} of manifest.json")
    return path, name, data, sha256


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Turn a ValueError that says what is wrong with a file into a ModelError that also names the file."""
    try:
        yield
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from error


def shipped_gestures(source: str | Path) -> tuple[str, ...]:
    """The gestures of a shipped model, by the manifest, if its file has the right sha256. Raises ModelError."""
    path, *_ = read(source)
    with naming(path):
        return tuple(_manifest(path, "gestures"))


def _manifest(path: Path, key: str) -> Any:
    try:
        return json.loads((path.parent / "manifest.json").read_text())["models"][path.name][key]
    except (OSError, ValueError, KeyError, TypeError):
        raise ValueError(f"is a shipped model, expected its {key} in the manifest.json beside it") from None
