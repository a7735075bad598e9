"""Operating points and certainty of a model, read from the parsed JSON of `operating_points` and `provisional`.

Functions here raise ValueError, which names the key and what was expected.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from gestured.core.points import STRICTNESS, Certainty, Curve, Needed, Point

MOST = 1e6  # the most hours, and false gestures an hour: no measurement has more, and floats can hold it
MOST_ROWS = 1000  # the most rows of the curve
MOST_IN_A_ROW = 100  # the most frames in a row: a model that needs more says nothing in time
MOST_S = 3600.0  # the longest elapsed time, longer than any contact
COSTS = {"missed": 1.0, "false_per_hour": MOST, "hours": MOST}  # of a point, each with the most that it may be


def operating_points(found: Mapping[str, Any], gestures: Collection[str]) -> tuple[Mapping[str, Point], Curve]:
    """The operating points in `found`, by strictness, and their curve, for a model of these gestures."""
    _require_keys("", found, (*STRICTNESS, "curve"))
    points: dict[str, Point] = {
        strictness: _point(strictness, found[strictness], gestures) for strictness in STRICTNESS
    }
    return points, _curve(found["curve"])


def certainty(found: Mapping[str, Any], gestures: Collection[str]) -> Certainty:
    """The certainty in `found`, for a model of these gestures."""
    _require_keys("", {"gestures": {}, **found}, ("in_a_row", "elapsed_s", "thresholds", "tap", "gestures"))
    row, begins, own = found["in_a_row"], found["elapsed_s"], found.get("gestures", {})
    if isinstance(row, bool) or not isinstance(row, int) or not 1 <= row <= MOST_IN_A_ROW:
        raise ValueError(f"in_a_row: expected a whole number from 1 to {MOST_IN_A_ROW}, found {_brief(row)}")
    if not isinstance(begins, list) or begins[:1] != [0]:
        raise ValueError(f"elapsed_s: expected a list of seconds, the first 0, found {_brief(begins)}")
    elapsed_s = tuple(number("elapsed_s", value, MOST_S) for value in begins)
    _require_rising("elapsed_s", elapsed_s)
    if not isinstance(own, dict) or not set(own) <= set(gestures):
        raise ValueError(f"gestures: expected an object of the model's own gestures, found {_brief(own)}")
    return Certainty(
        in_a_row=row,
        elapsed_s=elapsed_s,
        thresholds=_needed("thresholds", found["thresholds"], len(begins)),
        gestures={name: _needed(f"gestures: {name}", needed, len(begins)) for name, needed in own.items()},
        tap=_confidence("tap", found["tap"]),
    )


def _point(key: str, found: Any, gestures: Collection[str]) -> Point:
    _require_keys(f"{key}: ", found, ("thresholds", "provisional", *COSTS))
    thresholds = found["thresholds"]
    _require_keys(f"{key}: thresholds: ", thresholds, gestures)
    return Point(
        thresholds={name: number(f"{key}: thresholds: {name}", thresholds[name], 1.0) for name in gestures},
        provisional=_confidence(f"{key}: provisional", found["provisional"]),
        **{name: number(f"{key}: {name}", found[name], most) for name, most in COSTS.items()},
    )


def _curve(found: Any) -> tuple[tuple[float, float, float], ...]:
    right = isinstance(found, list) and 1 <= len(found) <= MOST_ROWS
    if not right or not all(isinstance(row, list) and len(row) == 3 for row in found):
        raise ValueError(
            f"curve: expected 1 to {MOST_ROWS} rows of threshold, missed and false an hour, found {_brief(found)}"
        )
    rows = tuple((number("curve", a, 1.0), number("curve", b, 1.0), number("curve", c, MOST)) for a, b, c in found)
    _require_rising("curve", [threshold for threshold, _, _ in rows])
    return rows


def _needed(key: str, found: Any, length: int) -> Needed:
    if not isinstance(found, list) or len(found) != length:
        raise ValueError(f"{key}: expected a list of {length} confidences, one for each stretch, found {_brief(found)}")
    return tuple(_confidence(key, value) for value in found)


def _confidence(key: str, found: Any) -> float | None:
    """A confidence, or None if none is enough."""
    return None if found is None else number(key, found, 1.0)


def number(key: str, found: Any, most: float) -> float:
    """A number from 0 to `most`. Raises ValueError for anything else."""
    if isinstance(found, bool) or not isinstance(found, int | float) or not 0 <= found <= most:
        raise ValueError(f"{key}: expected a number from 0 to {most:g}, found {_brief(found)}")
    return float(found)


def _require_rising(key: str, values: Sequence[float]) -> None:
    if any(one >= other for one, other in zip(values, values[1:], strict=False)):
        raise ValueError(f"{key}: expected values that rise, found {_brief(values)}")


def _require_keys(where: str, found: Any, keys: Collection[str]) -> None:
    if not isinstance(found, dict) or set(found) != set(keys):
        raise ValueError(f"{where}expected an object with {', '.join(keys)}, found {_brief(found)}")


def _brief(value: object) -> str:
    return repr(value)[:60]
