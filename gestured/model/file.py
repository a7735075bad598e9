"""A model's file before onnxruntime sees it: its bytes, its digest, its self-test, and that it needs no other file.

Functions here raise ValueError with the reason; `shipped.naming` adds the file's name.
"""

import base64
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.record.files import open_regular

# Far more than a net for a grid of taxels needs. While a file is opened, memory holds it some five times.
MAX_MODEL_BYTES = 32 << 20
# The bytes of a file before the 64 characters of its digest: the head of a protobuf entry of `metadata_props`.
DIGEST = b"\x72\x4a\x0a\x06digest\x12\x40"
# The word `location`, by which a tensor names the file of its data, after the word's length as protobuf writes it.
_LOCATION = re.compile(rb"(?:\x08|\x88\x80*\x00)location")


def read_bytes(path: Path) -> bytes:
    """The bytes of a regular file of at most `MAX_MODEL_BYTES`, read once. Raises ValueError for any other file."""
    try:
        with open_regular(path) as file:
            data = file.read(MAX_MODEL_BYTES + 1)
    except OSError as error:
        raise ValueError(f"cannot be opened: {error.strerror}") from error
    if not data:
        raise ValueError("is empty, expected an ONNX model")
    if len(data) > MAX_MODEL_BYTES:
        raise ValueError(f"has more than {MAX_MODEL_BYTES} bytes, the most that a model may have")
    return data


def sealed(data: bytes) -> bytes:
    """An exported model with its digest at its end: an entry `digest` of its metadata, the sha256 of all before it."""
    return data + DIGEST + hashlib.sha256(data).hexdigest().encode()


def has_digest(data: bytes) -> bool:
    """Whether a model's file ends in a digest. Raises ValueError if it is not the digest of what comes before."""
    end = len(data) - len(DIGEST) - 2 * hashlib.sha256().digest_size
    found = data[max(end, 0) : max(end, 0) + len(DIGEST)]
    # A digest with a damaged head counts as a digest: the end of any other entry has hardly a byte in common with it.
    if sum(one == other for one, other in zip(found, DIGEST, strict=False)) < len(DIGEST) // 2:
        return False
    if data != sealed(data[:end]):
        raise ValueError("is damaged, or was changed after its export: its digest is that of another content")
    return True


def check_alone(data: bytes) -> None:
    """Raise ValueError for a model with data in another file, which onnxruntime would read with this process's rights.

    onnxruntime follows names relative to the current folder, and version 1.24 also links, absolute names and addresses
    in memory. It refuses by itself data in another file without a `location` (tests/test_models.py).
    """
    if _LOCATION.search(data):
        raise ValueError("keeps data in another file, expected everything in this one")


def packed(values: NDArray[np.floating[Any]]) -> str:
    """Numbers as base64 of little-endian float32, without their shape."""
    return base64.b64encode(np.ascontiguousarray(values, "<f4").tobytes()).decode()


def unpacked(text: object) -> NDArray[np.float32]:
    """The (n,) numbers that `packed` wrote. Raises TypeError or ValueError for anything else, or if not finite."""
    if not isinstance(text, str):
        raise TypeError("expected base64")
    values = np.frombuffer(base64.b64decode(text, validate=True), "<f4").astype(np.float32)
    if not np.isfinite(values).all():
        raise ValueError("expected finite numbers")
    return values


@dataclass(frozen=True, eq=False)
class SelfTest:
    """An input, and the outputs that the trained model gave for it."""

    values: NDArray[np.float32]  # (B, T, R, C) or (B, F)
    scores: NDArray[np.float32]  # (B, G)
    unknown: NDArray[np.float32]  # (B,)

    def to_json(self) -> str:
        """Input values as `packed` writes them, outputs as plain numbers."""
        return json.dumps(
            {
                "shape": list(self.values.shape),
                "values": packed(self.values),
                "scores": [[round(float(v), 7) for v in row] for row in self.scores],
                "unknown": [round(float(v), 7) for v in self.unknown],
            }
        )

    @classmethod
    def from_json(cls, stored: Mapping[str, Any]) -> "SelfTest":
        """The self-test of the parsed JSON that `to_json` wrote. Raises ValueError, which says what was expected."""
        try:
            values = unpacked(stored["values"]).reshape(stored["shape"])
            scores, unknown = (np.asarray(stored[key], np.float32) for key in ("scores", "unknown"))
        except (KeyError, TypeError, ValueError, OverflowError):
            raise ValueError("expected a shape, its values as base64 float32, and lists: scores, unknown") from None
        batch = values.shape[:1]
        same = batch == scores.shape[:1] == unknown.shape
        if values.ndim not in (2, 4) or not values.size or scores.ndim != 2 or not same:
            raise ValueError("expected values (B, T, R, C) or (B, F), scores (B, G) and unknown (B,)")
        if not all(np.isfinite(array).all() for array in (scores, unknown)):
            raise ValueError("a value is not finite")
        return cls(values, scores, unknown)
