"""What an .onnx file says about itself, read without onnxruntime.

A model file may be damaged or hostile. Before its bytes reach onnxruntime, `inspect` walks the protobuf
wire format once, with a stack of its own and a bounded number of steps: it takes the metadata, and refuses
data kept in other files and tensors that claim to be larger than what is there. `Metadata.parse` then holds
every key against the contract. Field numbers are those of onnx.proto (ONNX 1.23).

Functions here raise ValueError with the reason; `model.open_model` adds the file's name.
"""

import base64
import binascii
import json
import math
import os
import re
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.foresight import Certainty
from gestured.core.prototypes import Space
from gestured.core.window import Window

MAX_MODEL_BYTES = 64 * 1024 * 1024
MAX_FIELDS = 500_000  # protobuf fields that are looked at; a shipped model has some thousands
MAX_MESSAGE_DEPTH = 16  # messages inside messages
MAX_PROPERTIES = 64  # metadata; a shipped model has a dozen
MAX_TEXT = 2 << 20  # bytes of one of them; the largest is the self-test, some kilobytes
MAX_METADATA = 4 << 20  # bytes of all of them
MAX_ITEMS = 50_000  # of the lists and objects in one; each costs a hundred times as much memory as text
MAX_NESTING = 16  # lists and objects inside each other in one
MAX_SELF_TEST = 400_000  # values; more are no MAX_TEXT
GESTURE_NAME = re.compile(r"[a-z0-9_]{1,64}")

# (message, field number) -> the message inside that is looked at; everything else is skipped.
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
_REFUSED = {
    ("model", 20): "training information",
    ("graph", 15): "sparse tensors",
    ("attribute", 22): "sparse tensors",
    ("attribute", 23): "sparse tensors",
}
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
        fields = []
        for field in _fields(data, start, end):
            steps += 1
            if steps > MAX_FIELDS:
                raise ValueError(f"has more than {MAX_FIELDS} fields, too many for a gesture model")
            number, wire, first, last = field
            if (kind, number) in _REFUSED:
                raise ValueError(f"has {_REFUSED[kind, number]}, which gestured does not take")
            if kind in ("tensor", "property"):
                fields.append(field)
            elif (inside := _INSIDE.get((kind, number))) is not None:
                if wire != 2:
                    raise ValueError("is not an ONNX model (or damaged)")
                graphs += (kind, inside) == ("model", "graph")
                stack.append((inside, first, last, depth + 1))
        if kind == "tensor":
            _check_tensor(data, fields, end - start)
        elif kind == "property":
            _add_property(data, fields, properties)
    if graphs != 1:
        raise ValueError("is not an ONNX model: expected one graph in it")
    return properties


def _fields(data: bytes, at: int, end: int) -> Iterator[tuple[int, int, int, int]]:
    """(field number, wire type, first, last): a varint's value is `first`, else the payload's span."""
    while at < end:
        tag, at = _varint(data, at, end)
        number, wire = tag >> 3, tag & 7
        if wire == 0:
            value, at = _varint(data, at, end)
            yield number, wire, value, at
            continue
        if wire == 2:
            length, at = _varint(data, at, end)
        else:
            length = {1: 8, 5: 4}.get(wire, -1)
        if number == 0 or length < 0 or length > end - at:
            raise ValueError("is not an ONNX model, or is truncated or damaged")
        yield number, wire, at, at + length
        at += length


def _varint(data: bytes, at: int, end: int) -> tuple[int, int]:
    if at < end and data[at] < 0x80:  # most are a single byte
        return data[at], at + 1
    value = 0
    for shift in range(0, 70, 7):
        if at >= end:
            break
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise ValueError("is not an ONNX model, or is truncated or damaged")


def _check_tensor(data: bytes, fields: list[tuple[int, int, int, int]], size: int) -> None:
    """A tensor must bring its values itself: as many as its dimensions claim."""
    count = 1
    item = 0
    raw = -1
    for number, wire, first, last in fields:
        if number == 13 or (number == 14 and first != 0):
            raise ValueError("keeps data in another file, expected everything in this one")
        if number == 1 and wire == 0:
            count *= first
        elif number == 1:
            at = first
            while at < last:
                value, at = _varint(data, at, last)
                count = min(count * value, 1 << 63)
        elif number == 2:
            item = _ITEM_BYTES.get(first, 0)
        elif number == 9:
            raw = last - first
        count = min(count, 1 << 63)
    # Packed 4-bit values are two to a byte; every other encoding needs at least a byte a value.
    if (raw >= 0 and item and count * item != raw) or count > 2 * size:
        raise ValueError(f"has a tensor that claims {count} values but does not hold them")


def _add_property(data: bytes, fields: list[tuple[int, int, int, int]], properties: dict[str, str]) -> None:
    texts = {1: "", 2: ""}
    for number, wire, first, last in fields:
        if wire == 2 and number in texts:
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
    def from_json(cls, text: str) -> "SelfTest":
        """The inverse of `to_json`; ValueError says what is wrong."""
        stored = _json(text, "self_test", dict)
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


@dataclass(frozen=True, eq=False)
class Metadata:
    """A model file's `metadata_props`, checked."""

    gestures: tuple[str, ...]
    kind: str
    version: str
    rows: int
    columns: int
    rate_hz: float
    window: Window
    features: tuple[str, ...] | None  # names, where the model takes features instead of frames
    calibration: Mapping[str, Any]
    training_data: str  # sha256
    quantiles: Mapping[str, Any]  # what the training data looked like
    self_test: SelfTest
    provisional: Certainty | None  # how sure it must be of a contact that is not over, where it was made for that
    own: Space | None  # where gestures of the user's own are compared; None for a model that cannot

    @classmethod
    def parse(cls, properties: Mapping[str, str]) -> "Metadata":
        """Holds every key against the contract; ValueError names the key and what was expected."""
        required = ("gestures", "kind", "version", "rows", "columns", "rate_hz", "window", "calibration")
        missing = [k for k in (*required, "self_test", "training_data", "quantiles") if k not in properties]
        if missing:
            raise ValueError(f"has no metadata {', '.join(map(repr, missing))}, expected gestured's own")
        for key, text in properties.items():
            _check_extent(key, text)
        gestures = _names(properties, "gestures", 2, 64)
        if not all(GESTURE_NAME.fullmatch(name) for name in (*gestures, properties["kind"])):
            raise ValueError("metadata 'gestures' and 'kind': expected 1 to 64 of a-z, 0-9, _ each")
        if not 1 <= len(properties["version"]) <= 64 or not properties["version"].isprintable():
            raise ValueError("metadata 'version': expected 1 to 64 printable characters")
        if not re.fullmatch(r"[0-9a-f]{64}", properties["training_data"]):
            raise ValueError("metadata 'training_data': expected a sha256 in hexadecimal")
        with _naming("window"):
            window = Window.from_json(properties["window"])
        provisional = own = None
        if "provisional" in properties:
            with _naming("provisional"):
                provisional = Certainty.from_json(properties["provisional"], gestures)
        if "own" in properties:
            told = _json(properties["own"], "own", dict)
            with _naming("own"):
                own = Space.from_json(told, len(gestures))
        grid = {}
        for key in ("rows", "columns", "rate_hz"):
            try:
                grid[key] = float(properties[key])
            except ValueError:
                grid[key] = math.nan
            if grid[key] != getattr(window, key):
                found, expected = properties[key][:40], getattr(window, key)
                raise ValueError(f"metadata {key!r} is {found!r}, expected {expected} as in 'window'")
        return cls(
            gestures=gestures,
            kind=properties["kind"],
            version=properties["version"],
            rows=window.rows,
            columns=window.columns,
            rate_hz=window.rate_hz,
            window=window,
            features=_names(properties, "features", 1, 10_000) if "features" in properties else None,
            calibration=_json(properties["calibration"], "calibration", dict),
            training_data=properties["training_data"],
            quantiles=_json(properties["quantiles"], "quantiles", dict),
            self_test=SelfTest.from_json(properties["self_test"]),
            provisional=provisional,
            own=own,
        )


@contextmanager
def _naming(key: str) -> Iterator[None]:
    """Have a ValueError say in which key of the metadata the mistake is."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"metadata {key!r}: {error}") from error


def _check_extent(key: str, text: str) -> None:
    """Counts what JSON in a value would become, before it is parsed."""
    items = depth = 0
    for found in re.finditer(r"[][{},]", text):
        items += found[0] in "[{,"
        depth += (found[0] in "[{") - (found[0] in "]}")
        if items > MAX_ITEMS or depth > MAX_NESTING:
            raise ValueError(
                f"metadata {key[:64]!r}: expected at most {MAX_ITEMS} items, {MAX_NESTING} inside each other"
            )


def _names(properties: Mapping[str, str], key: str, least: int, most: int) -> tuple[str, ...]:
    names = _json(properties[key], key, list)
    if not (least <= len(names) <= most and all(isinstance(name, str) for name in names)):
        raise ValueError(f"metadata {key!r}: expected {least} to {most} names")
    if len(set(names)) != len(names):
        raise ValueError(f"metadata {key!r}: expected names that differ")
    return tuple(names)


def _json(text: str, key: str, kind: type) -> Any:
    def refuse(constant: str) -> None:
        raise ValueError(constant)  # NaN and Infinity are no JSON

    try:
        value = json.loads(text, parse_constant=refuse)
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, kind):
        raise ValueError(f"metadata {key!r}: expected a JSON {'list' if kind is list else 'object'}")
    return value
