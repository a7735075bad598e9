"""What is in an .onnx file, read without onnxruntime: its metadata, and the self-test that it brings.

A model file may be damaged or hostile. Before its bytes reach onnxruntime, `inspect` walks them once, with a stack of
its own and a bounded number of steps: it takes the metadata, and refuses data kept in other files and tensors that
claim to be larger than what is there. Field numbers are those of onnx.proto (ONNX 1.23).

Functions here raise ValueError with the reason; `model.open_model` adds the file's name.
"""

import base64
import binascii
import hashlib
import json
import math
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.model.protobuf import BYTES, VARINT, Field, fields, varint

MAX_MODEL_BYTES = 64 << 20  # far more than a net for a grid of taxels needs; a file is held in memory
MAX_FIELDS = 500_000  # protobuf fields that are looked at; a shipped model has some thousands
MAX_MESSAGE_DEPTH = 16  # messages inside messages
MAX_PROPERTIES = 64  # entries of metadata; a shipped model has a dozen
MAX_TEXT = 2 << 20  # bytes of one entry of metadata; the largest is the self-test, some kilobytes
MAX_METADATA = 4 << 20  # bytes of all entries of metadata together
# What stands in a file before the 64 characters of its digest: the head of a protobuf entry of `metadata_props`.
DIGEST = b"\x72\x4a\x0a\x06digest\x12\x40"
MAX_SELF_TEST = 400_000  # numbers of a self-test's input; more do not fit into MAX_TEXT
MOST_VALUES = 1 << 63  # values of a tensor, as far as they are counted: what claims more claims too much anyway

# (message, field number) -> the message inside that is looked at; everything else is skipped. "property" stands for
# StringStringEntryProto.
_INSIDE = {
    ("model", 7): "graph",
    ("model", 14): "property",
    ("model", 25): "function",
    ("graph", 1): "node",
    ("graph", 5): "tensor",
    ("function", 7): "node",
    ("function", 11): "attribute",
    ("node", 5): "attribute",
    ("attribute", 5): "tensor",
    ("attribute", 6): "graph",
    ("attribute", 10): "tensor",
    ("attribute", 11): "graph",
}
# (message, field number) -> what a model may have, and none of ours does.
_REFUSED = {
    ("model", 20): "training information",
    ("graph", 15): "sparse tensors",
    ("attribute", 22): "sparse tensors",
    ("attribute", 23): "sparse tensors",
}
# The fields of a tensor that tell how much it holds, and where.
DIMS, DATA_TYPE, RAW_DATA, EXTERNAL_DATA, DATA_LOCATION = 1, 2, 9, 13, 14
# TensorProto.DataType -> bytes of a value in raw_data, where that is a whole number.
_ITEM_BYTES = {
    1: 4, 2: 1, 3: 1, 4: 2, 5: 2, 6: 4, 7: 8, 9: 1, 10: 2, 11: 8, 12: 4, 13: 8, 14: 8, 15: 16, 16: 2,
}  # fmt: skip


def read_bytes(path: Path) -> bytes:
    """The file's bytes, read once; a regular file of at most `MAX_MODEL_BYTES`."""
    try:
        # Non-blocking: opening a FIFO must not wait for a writer.
        file = open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK))
    except (OSError, ValueError) as error:
        raise ValueError(f"cannot be opened: {getattr(error, 'strerror', None) or error}") from error
    with file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise ValueError("is not a regular file")
        if status.st_size > MAX_MODEL_BYTES:
            raise ValueError(f"has {status.st_size} bytes, expected at most {MAX_MODEL_BYTES}")
        try:
            data = file.read(MAX_MODEL_BYTES + 1)
        except OSError as error:
            raise ValueError(f"cannot be read: {error.strerror or error}") from error
    if not data:
        raise ValueError("is empty, expected an ONNX model")
    if len(data) > MAX_MODEL_BYTES:
        raise ValueError(f"grew while it was read, expected at most {MAX_MODEL_BYTES} bytes")
    return data


def sealed(data: bytes) -> bytes:
    """An exported model with its digest at its end: an entry `digest` of its metadata, the sha256 of all before it."""
    return data + DIGEST + hashlib.sha256(data).hexdigest().encode()


def has_digest(data: bytes) -> bool:
    """Whether a model's file ends in its digest; ValueError where that is not the digest of what comes before."""
    end = len(data) - len(DIGEST) - 2 * hashlib.sha256().digest_size
    found = data[max(end, 0) : max(end, 0) + len(DIGEST)]
    # A digest whose own name is damaged is still one; the end of any other entry has hardly a byte in common with it.
    if sum(one != other for one, other in zip(found, DIGEST, strict=False)) > len(DIGEST) // 2:
        return False
    if data != sealed(data[:end]):
        raise ValueError("is damaged, or was changed after its export: its digest is that of another content")
    return True


def inspect(data: bytes) -> dict[str, str]:
    """The model's `metadata_props`, after a bounded walk over everything that holds a tensor."""
    properties: dict[str, str] = {}
    graphs = 0
    steps = 0
    stack = [("model", 0, len(data), 0)]
    while stack:
        kind, start, end, depth = stack.pop()
        if depth > MAX_MESSAGE_DEPTH:
            raise ValueError(f"nests deeper than {MAX_MESSAGE_DEPTH} messages")
        found: list[Field] = []
        for field in fields(data, start, end):
            steps += 1
            if steps > MAX_FIELDS:
                raise ValueError(f"has more than {MAX_FIELDS} fields, too many for a gesture model")
            number, wire, first, last = field
            if (kind, number) in _REFUSED:
                raise ValueError(f"has {_REFUSED[kind, number]}, which gestured does not take")
            if kind in ("tensor", "property"):
                found.append(field)
            elif (inside := _INSIDE.get((kind, number))) is not None:
                if wire != BYTES:
                    raise ValueError("is not an ONNX model (or damaged)")
                graphs += (kind, inside) == ("model", "graph")
                stack.append((inside, first, last, depth + 1))
        if kind == "tensor":
            _check_tensor(data, found, end - start)
        elif kind == "property":
            _add_property(data, found, properties)
    if graphs != 1:
        raise ValueError("is not an ONNX model: expected one graph in it")
    return properties


def _check_tensor(data: bytes, found: list[Field], size: int) -> None:
    """A tensor must bring its values itself: as many as its dimensions claim."""
    count = 1
    item = 0
    raw = -1
    for number, wire, first, last in found:
        if number == EXTERNAL_DATA or (number == DATA_LOCATION and first != 0):
            raise ValueError("keeps data in another file, expected everything in this one")
        if number == DIMS and wire == VARINT:
            count *= first
        elif number == DIMS:  # several of them, packed
            at = first
            while at < last:
                value, at = varint(data, at, last)
                count = min(count * value, MOST_VALUES)
        elif number == DATA_TYPE:
            item = _ITEM_BYTES.get(first, 0)
        elif number == RAW_DATA:
            raw = last - first
        count = min(count, MOST_VALUES)
    # Packed 4-bit values are two to a byte; every other encoding needs at least a byte a value.
    if (raw >= 0 and item and count * item != raw) or count > 2 * size:
        raise ValueError(f"has a tensor that claims {count} values but does not hold them")


def _add_property(data: bytes, found: list[Field], properties: dict[str, str]) -> None:
    texts = {1: "", 2: ""}  # field number -> key, value
    for number, wire, first, last in found:
        if wire == BYTES and number in texts:
            if last - first > MAX_TEXT:
                # What is too long may come before its own name, or be it.
                raise ValueError(f"has metadata {texts[1][:64]!r} of {last - first} bytes, expected at most {MAX_TEXT}")
            try:
                texts[number] = data[first:last].decode()
            except UnicodeDecodeError:
                raise ValueError("has metadata that is not UTF-8") from None
    if texts[1] in properties:
        raise ValueError(f"has the metadata key {texts[1][:64]!r} twice")
    properties[texts[1]] = texts[2]
    if len(properties) > MAX_PROPERTIES:
        raise ValueError(f"has too many metadata, expected at most {MAX_PROPERTIES}")
    if sum(len(key) + len(text) for key, text in properties.items()) > MAX_METADATA:
        raise ValueError(f"has too long metadata, expected at most {MAX_METADATA} bytes in all")


@dataclass(frozen=True, eq=False)
class SelfTest:
    """An input and what the trained model made of it."""

    values: NDArray[np.float32]  # (B, T, R, C) or (B, F)
    scores: NDArray[np.float32]  # (B, G)
    unknown: NDArray[np.float32]  # (B,)

    def to_json(self) -> str:
        """Input values as base64 of little-endian float32, outputs as plain numbers."""
        values = base64.b64encode(np.ascontiguousarray(self.values, "<f4").tobytes()).decode()
        return json.dumps(
            {
                "shape": list(self.values.shape),
                "values": values,
                "scores": [[round(float(v), 7) for v in row] for row in self.scores],
                "unknown": [round(float(v), 7) for v in self.unknown],
            }
        )

    @classmethod
    def from_json(cls, stored: Mapping[str, Any]) -> "SelfTest":
        """What `to_json` wrote, parsed; ValueError says what is wrong."""
        missing = [key for key in ("shape", "values", "scores", "unknown") if key not in stored]
        if missing:
            raise ValueError(f"metadata 'self_test' has no {missing[0]!r}")
        shape = stored["shape"]
        if not (
            isinstance(shape, list)
            and len(shape) in (2, 4)
            and all(isinstance(n, int) and not isinstance(n, bool) and n > 0 for n in shape)
            and math.prod(shape) <= MAX_SELF_TEST
        ):
            raise ValueError("metadata 'self_test': expected a shape (B, T, R, C) or (B, F)")
        try:
            values = np.frombuffer(base64.b64decode(stored["values"], validate=True), "<f4")
            values = values.reshape(shape).astype(np.float32)
            scores = np.asarray(stored["scores"], np.float32)
            unknown = np.asarray(stored["unknown"], np.float32)
        except (TypeError, ValueError, OverflowError, binascii.Error):
            raise ValueError("metadata 'self_test': expected base64 float32 and lists of numbers") from None
        if scores.ndim != 2 or unknown.shape != (shape[0],) or len(scores) != shape[0]:
            raise ValueError("metadata 'self_test': expected scores (B, G) and unknown (B,) of its input")
        if not all(np.isfinite(array).all() for array in (values, scores, unknown)):
            raise ValueError("metadata 'self_test': a value is not finite")
        return cls(values, scores, unknown)
