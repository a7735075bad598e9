"""Reads the metadata `operating_points` of a model, parsed JSON, as `OperatingPoints`."""

from collections.abc import Collection, Mapping
from typing import Any

from gestured.core.points import STRICTNESS, OperatingPoints, Point

MOST = 1e6  # hours, and false gestures an hour: no measurement has more, and it keeps numbers within a float's range
MOST_ROWS = 1000  # of the curve
KEYS = ("thresholds", "provisional", "missed", "false_per_hour", "hours")


def operating_points(found: Mapping[str, Any], gestures: Collection[str]) -> OperatingPoints:
    """The points that `found` holds for a model of these gestures; raises ValueError naming the key."""
    if set(found) != {*STRICTNESS, "curve"}:
        raise ValueError(f"expected {', '.join(STRICTNESS)} and curve, found {_brief(list(found))}")
    return OperatingPoints(
        {strictness: _point(strictness, found[strictness], gestures) for strictness in STRICTNESS},
        _curve(found["curve"]),
    )


def _point(key: str, found: Any, gestures: Collection[str]) -> Point:
    if not isinstance(found, dict) or set(found) != set(KEYS):
        raise ValueError(f"{key}: expected an object with {', '.join(KEYS)}, found {_brief(found)}")
    thresholds, provisional = found["thresholds"], found["provisional"]
    if not isinstance(thresholds, dict) or set(thresholds) != set(gestures):
        raise ValueError(
            f"{key}: thresholds: expected one for each of the model's gestures, found {_brief(thresholds)}"
        )
    return Point(
        thresholds={name: _number(f"{key}: thresholds: {name}", thresholds[name], 1) for name in gestures},
        provisional=None if provisional is None else _number(f"{key}: provisional", provisional, 1),
        missed=_number(f"{key}: missed", found["missed"], 1),
        false_per_hour=_number(f"{key}: false_per_hour", found["false_per_hour"], MOST),
        hours=_number(f"{key}: hours", found["hours"], MOST),
    )


def _curve(found: Any) -> tuple[tuple[float, float, float], ...]:
    if not isinstance(found, list) or not 1 <= len(found) <= MOST_ROWS:
        raise ValueError(f"curve: expected a list of 1 to {MOST_ROWS} rows, found {_brief(found)}")
    rows = []
    for row in found:
        if not isinstance(row, list) or len(row) != 3:
            raise ValueError(f"curve: expected rows of threshold, missed and false an hour, found {_brief(row)}")
        threshold, missed = (_number("curve", value, 1) for value in row[:2])
        rows.append((threshold, missed, _number("curve", row[2], MOST)))
        if len(rows) > 1 and threshold <= rows[-2][0]:
            raise ValueError(f"curve: expected thresholds that rise, found {threshold:g} after {rows[-2][0]:g}")
    return tuple(rows)


def _number(key: str, found: Any, most: float) -> float:
    if isinstance(found, bool) or not isinstance(found, int | float) or not 0 <= found <= most:
        raise ValueError(f"{key}: expected a number from 0 to {most:g}, found {_brief(found)}")
    return float(found)


def _brief(value: object) -> str:
    return repr(value)[:60]
