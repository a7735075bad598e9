"""What a model says of itself: the metadata of its file, checked key by key.

Functions here raise ValueError with the key and what was expected; `model.open_model` adds the file's name.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from gestured.core.points import Certainty, OperatingPoints
from gestured.core.window import Window
from gestured.model.certainty import certainty
from gestured.model.context import NAMES as CONTEXT
from gestured.model.features import feature_names
from gestured.model.file import SelfTest
from gestured.model.points import operating_points
from gestured.model.prototypes import Space

MAX_TEXT = 2 << 20  # characters of one value; the longest is the self-test, some thousands
MAX_ITEMS = 50_000  # of the lists and objects in one value; each costs a hundred times as much memory as text
MAX_NESTING = 16  # lists and objects inside each other in one value
USUAL_THRESHOLD = 0.5  # of a model whose calibration has none: more probably right than wrong
GESTURE_NAME = re.compile(r"[a-z0-9_]{1,64}")


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
    context: tuple[str, ...] | None  # names of what surrounds a segment that the model takes in, too
    calibration: Mapping[str, Any]
    threshold: float  # the confidence from which an answer is published where there are no `points`
    training_data: str  # sha256
    quantiles: Mapping[str, Any]  # what the training data looked like
    self_test: SelfTest
    provisional: Certainty | None  # how sure it must be of a contact that is not over, where it was made for that
    points: OperatingPoints | None  # thresholds by strictness, and what they cost
    own: Space | None  # where gestures of the user's own are compared; None for a model that cannot

    @classmethod
    def parse(cls, properties: Mapping[str, str], *, sealed: bool = False) -> "Metadata":
        """Check every key; ValueError names the key and what was expected.

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
        gestures = _names(properties, "gestures", 2, 64)
        if not all(GESTURE_NAME.fullmatch(name) for name in (*gestures, properties["kind"])):
            raise ValueError("metadata 'gestures' and 'kind': expected 1 to 64 of a-z, 0-9, _ each")
        if not 1 <= len(properties["version"]) <= 64 or not properties["version"].isprintable():
            raise ValueError("metadata 'version': expected 1 to 64 printable characters")
        if not re.fullmatch(r"[0-9a-f]{64}", properties["training_data"]):
            raise ValueError("metadata 'training_data': expected a sha256 in hexadecimal")
        with _naming("window"):
            window = Window.from_json(properties["window"])
        provisional = own = points = None
        if "provisional" in properties:
            with _naming("provisional"):
                provisional = certainty(properties["provisional"], gestures)
        if "operating_points" in properties:
            told = _json(properties["operating_points"], "operating_points", dict)
            with _naming("operating_points"):
                points = operating_points(told, gestures)
        if "own" in properties:
            told = _json(properties["own"], "own", dict)
            with _naming("own"):
                own = Space.from_json(told, len(gestures))
        context = _context(properties) if "context" in properties else None
        _check_grid(properties, window)
        calibration = _json(properties["calibration"], "calibration", dict)
        return cls(
            gestures=gestures,
            kind=properties["kind"],
            version=properties["version"],
            rows=window.rows,
            columns=window.columns,
            rate_hz=window.rate_hz,
            window=window,
            features=_features(properties, window) if "features" in properties else None,
            context=context,
            calibration=calibration,
            threshold=_threshold(calibration),
            training_data=properties["training_data"],
            quantiles=_json(properties["quantiles"], "quantiles", dict),
            self_test=SelfTest.from_json(_json(properties["self_test"], "self_test", dict)),
            provisional=provisional,
            points=points,
            own=own,
        )


def _check_grid(properties: Mapping[str, str], window: Window) -> None:
    """Grid and rate stand in the metadata by themselves, too, and must be the window's."""
    for key in ("rows", "columns", "rate_hz"):
        expected = getattr(window, key)
        try:
            found = float(properties[key])
        except ValueError:
            found = math.nan
        if found != expected:
            raise ValueError(f"metadata {key!r} is {properties[key][:40]!r}, expected {expected} as in 'window'")


@contextmanager
def _naming(key: str) -> Iterator[None]:
    """Have a ValueError say in which key of the metadata the mistake is."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"metadata {key!r}: {error}") from error


def _check_extent(key: str, text: str) -> None:
    """Raises ValueError for a value whose JSON would take too much memory; it is counted before it is parsed."""
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


def _names(properties: Mapping[str, str], key: str, least: int, most: int) -> tuple[str, ...]:
    names = _json(properties[key], key, list)
    if not (least <= len(names) <= most and all(isinstance(name, str) for name in names)):
        raise ValueError(f"metadata {key!r}: expected {least} to {most} names")
    if len(set(names)) != len(names):
        raise ValueError(f"metadata {key!r}: expected names that differ")
    return tuple(names)


def _features(properties: Mapping[str, str], window: Window) -> tuple[str, ...]:
    """The names of what a model takes instead of frames: all touch-pattern features of its grid, in their order."""
    expected = feature_names(window.rows, window.columns)
    if _names(properties, "features", 1, 10_000) != expected:
        raise ValueError(
            f"metadata 'features': expected the {len(expected)} touch-pattern features of a "
            f"{window.rows} x {window.columns} grid in their order"
        )
    return expected


def _context(properties: Mapping[str, str]) -> tuple[str, ...]:
    """The names of what surrounds a segment, all of which this version can tell."""
    names = _names(properties, "context", 1, len(CONTEXT))
    if odd := [name for name in names if name not in CONTEXT]:
        raise ValueError(f"metadata 'context': {odd[0]!r} is unknown, expected some of {', '.join(CONTEXT)}")
    return names


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


def _threshold(calibration: Mapping[str, Any]) -> float:
    """The confidence of the calibration from which an answer is published."""
    value = calibration.get("threshold", USUAL_THRESHOLD)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
        raise ValueError(f"metadata 'calibration': threshold: expected a number from 0 to 1, found {value!r}")
    return float(value)
