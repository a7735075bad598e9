"""Whose recordings a model learned from: written into the model's metadata, and read from there."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from gestured.lab.digest import file_digest
from gestured.model.file import read_bytes
from gestured.record.arrays import read

KEY = "learned_from"  # in an .onnx file's metadata: a JSON list of Origin


@dataclass(frozen=True, slots=True)
class Origin:
    """A file of recordings as it was when a model learned from it."""

    file: str
    sha256: str
    subjects: list[str]
    consents: dict[str, str] = field(default_factory=dict)  # subject -> the day of the latest consent that is known


def origins(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """The metadata `learned_from` about these files; a tape names no subjects. Raises RecordingError as `read` does."""
    return [asdict(_origin(path)) for path in paths]


def _origin(path: Path) -> Origin:
    if path.suffix != ".npz":
        return Origin(path.name, file_digest(path), [])
    found = read(path)
    subjects = found.subjects.astype(str).tolist()
    days: dict[str, str] = {}
    for subject, day in zip(subjects, [] if found.consents is None else found.consents.tolist(), strict=False):
        if day:
            days[subject] = max(day, days.get(subject, day))
    return Origin(path.name, file_digest(path), sorted(set(subjects)), days)


def said(model: Path) -> list[Origin] | None:
    """The recordings that a model learned from; None if its file does not say. Raises ValueError for no model."""
    import onnx
    from google.protobuf.message import DecodeError

    try:
        proto = onnx.load_model_from_string(read_bytes(model))
    except DecodeError as error:
        raise ValueError(f"is not an ONNX model: {error}") from error
    text = {entry.key: entry.value for entry in proto.metadata_props}.get(KEY)
    if text is None:
        return None
    try:
        return [
            Origin(str(o["file"]), str(o["sha256"]), [str(s) for s in o["subjects"]], dict(o.get("consents", {})))
            for o in json.loads(text)
        ]
    except (TypeError, KeyError, AttributeError, RecursionError) as error:
        raise ValueError(f"{KEY}: expected a list of file, sha256 and subjects: {error}") from error
