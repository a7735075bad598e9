"""The metadata of a model's file, in which the model describes itself, checked key by key.

Functions here raise ValueError with the key and what was expected; `shipped.naming` adds the file's name.
"""

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from gestured.core.points import Certainty, Curve, Point
from gestured.core.window import Window
from gestured.model.context import NAMES as CONTEXT
from gestured.model.features import feature_names
from gestured.model.file import SelfTest
from gestured.model.points import certainty, number, operating_points
from gestured.model.prototypes import Space

MAX_TEXT = 2 << 20  # the most characters of one value; the longest value is the self-test, some thousands
MAX_ITEMS = 50_000  # the most items in the lists and objects of one value; each takes a hundred times its text's memory
MAX_NESTING = 16  # the most lists and objects inside each other in one value
USUAL_THRESHOLD = 0.5  # of a model whose calibration has none: its answer is more probably right than wrong
GESTURE_NAME = re.compile(r"[a-z0-9_]{1,64}")
# Keys whose values are plain text: the pattern, and the same in words.
TEXTS = {
    "kind": (GESTURE_NAME, "1 to 64 of a-z, 0-9, _"),
    "version": (re.compile(r"[ -~]{1,64}"), "1 to 64 printable characters"),
    "training_data": (re.compile(r"[0-9a-f]{64}"), "a sha256 in hexadecimal"),
}
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Metadata:
    """A model file's `metadata_props`, checked."""

    gestures: tuple[str, ...]
    kind: str
    version: str
    window: Window
    features: tuple[str, ...] | None  # names of the features that the model takes instead of frames, if it does
    context: tuple[str, ...] | None  # names of the values of a contact's context that the model takes as well, if any
    calibration: Mapping[str, Any]
    threshold: float  # the confidence from which an answer is published if there are no `points`
    training_data: str  # sha256
    quantiles: Mapping[str, Any]  # what the training data looked like
    self_test: SelfTest
    provisional: Certainty | None  # how sure it must be of a contact that is not over, if it was made for that
    points: Mapping[str, Point] | None  # operating points, by strictness
    curve: Curve  # what one threshold for all gestures would cost; empty without `points`
    own: Space | None  # the space in which own gestures are compared; None for a model that has none

    @classmethod
    def parse(cls, properties: Mapping[str, str], *, sealed: bool = False) -> "Metadata":
        """The metadata of a file's `properties`, every key checked. Raises ValueError, which names the key.

        `sealed`: whether the file ends in a digest that is right.
        """
        if "digest" in properties and not sealed:
            raise ValueError("metadata 'digest': expected at the file's end; another program has written the file anew")
        required = ("gestures", "kind", "version", "rows", "columns", "rate_hz", "window", "calibration")
        missing = [k for k in (*required, "self_test", "training_data", "quantiles") if k not in properties]
        if missing:
            raise ValueError(f"has no metadata {', '.join(map(repr, missing))}, expected gestured's own")

        for key, text in properties.items():
            _check_extent(key, text)
        for key, (pattern, words) in TEXTS.items():
            if not pattern.fullmatch(properties[key]):
                raise ValueError(f"metadata {key!r}: expected {words}")

        def told(key: str, read: Callable[[str], T]) -> T:
            try:
                return read(properties[key])
            except ValueError as error:
                raise ValueError(f"metadata {key!r}: {error}") from error

        def perhaps(key: str, read: Callable[[str], T]) -> T | None:
            return told(key, read) if key in properties else None

        window = told("window", Window.from_json)
        _check_grid(properties, window)
        gestures = told("gestures", partial(_names, 2, 64))
        calibration = told("calibration", _object)
        threshold = calibration.get("threshold", USUAL_THRESHOLD)
        points, curve = perhaps("operating_points", lambda text: operating_points(_object(text), gestures)) or (
            None,
            (),
        )
        return cls(
            gestures=gestures,
            kind=properties["kind"],
            version=properties["version"],
            window=window,
            features=perhaps("features", partial(_features, window)),
            context=perhaps("context", _context),
            calibration=calibration,
            threshold=told("calibration", lambda _: number("threshold", threshold, 1.0)),
            training_data=properties["training_data"],
            quantiles=told("quantiles", _object),
            self_test=told("self_test", lambda text: SelfTest.from_json(_object(text))),
            provisional=perhaps("provisional", lambda text: certainty(_object(text), gestures)),
            points=points,
            curve=curve,
            own=perhaps("own", lambda text: Space.from_json(_object(text), len(gestures))),
        )


def _check_grid(properties: Mapping[str, str], window: Window) -> None:
    """Raise ValueError unless the grid and the rate, which have keys of their own, are those of the window."""
    for key in ("rows", "columns", "rate_hz"):
        expected = getattr(window, key)
        try:
            found = float(properties[key])
        except ValueError:
            found = math.nan
        if found != expected:
            raise ValueError(f"metadata {key!r} is {properties[key][:40]!r}, expected {expected} as in 'window'")


def _check_extent(key: str, text: str) -> None:
    """Raise ValueError for a value whose JSON would take too much memory; its items are counted before it is parsed."""
    if len(text) > MAX_TEXT:
        raise ValueError(f"metadata {key[:64]!r} has {len(text)} characters, expected at most {MAX_TEXT}")
    items = depth = 0
    for found in re.finditer(r"[][{},]", text):
        items += found[0] in "[{,"
        depth += (found[0] in "[{") - (found[0] in "]}")
        if items > MAX_ITEMS or depth > MAX_NESTING:
            raise ValueError(
                f"metadata {key[:64]!r}: expected at most {MAX_ITEMS} items, {MAX_NESTING} inside each other"
            )


def _names(least: int, most: int, text: str) -> tuple[str, ...]:
    names = _json(text, list)
    right = all(isinstance(name, str) and GESTURE_NAME.fullmatch(name) for name in names)
    if not right or not least <= len(names) <= most or len(set(names)) != len(names):
        raise ValueError(f"expected {least} to {most} names that differ, each 1 to 64 of a-z, 0-9, _")
    return tuple(names)


def _features(window: Window, text: str) -> tuple[str, ...]:
    """The names of a model's features, which must be all touch-pattern features of its grid, in their order."""
    expected = feature_names(window.rows, window.columns)
    if _json(text, list) != list(expected):
        grid = f"{window.rows} x {window.columns}"
        raise ValueError(f"expected the {len(expected)} touch-pattern features of a {grid} grid in their order")
    return expected


def _context(text: str) -> tuple[str, ...]:
    """The names of a model's context values, each of which this version must know."""
    names = _names(1, len(CONTEXT), text)
    if odd := [name for name in names if name not in CONTEXT]:
        raise ValueError(f"{odd[0]!r} is unknown, expected some of {', '.join(CONTEXT)}")
    return names


def _object(text: str) -> dict[str, Any]:
    found: dict[str, Any] = _json(text, dict)
    return found


def _json(text: str, kind: type) -> Any:
    def refuse(constant: str) -> None:
        raise ValueError(constant)  # NaN and Infinity are no JSON

    try:
        value = json.loads(text, parse_constant=refuse)
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, kind):
        raise ValueError(f"expected a JSON {'list' if kind is list else 'object'}")
    return value
