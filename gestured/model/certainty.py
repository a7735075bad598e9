"""Reads the metadata `provisional` of a model, JSON, as a `Certainty`."""

import json
from collections.abc import Collection
from typing import Any

from gestured.core.points import Certainty, Needed

MOST_IN_A_ROW = 100  # frames; a model that needs more says nothing in time
MOST_S = 3600.0  # longer than any contact; it also keeps each number within a float's range


def certainty(text: str, gestures: Collection[str]) -> Certainty:
    """The certainty that `text` holds for a model of these gestures; raises ValueError naming the key."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        found = None
    keys = {"in_a_row", "elapsed_s", "thresholds", "tap"}
    if not isinstance(found, dict) or set(found) - {"gestures"} != keys:
        raise ValueError(f"expected a JSON object with {', '.join(sorted(keys))}, and perhaps gestures")
    row = found["in_a_row"]
    if isinstance(row, bool) or not isinstance(row, int) or not 1 <= row <= MOST_IN_A_ROW:
        raise ValueError(f"in_a_row: expected a whole number from 1 to {MOST_IN_A_ROW}, found {_brief(row)}")
    begins = found["elapsed_s"]
    if not isinstance(begins, list) or not all(map(_is_number, begins)) or begins[:1] != [0]:
        raise ValueError(f"elapsed_s: expected a list of seconds, the first 0, found {_brief(begins)}")
    if not all(one < other for one, other in zip(begins, begins[1:], strict=False)):
        raise ValueError(f"elapsed_s: expected seconds that increase, found {_brief(begins)}")
    own = found.get("gestures", {})
    if not isinstance(own, dict) or not set(own) <= set(gestures):
        raise ValueError(f"gestures: expected an object of the model's own gestures, found {_brief(own)}")
    return Certainty(
        in_a_row=row,
        elapsed_s=tuple(map(float, begins)),
        thresholds=_needed("thresholds", found["thresholds"], len(begins)),
        gestures={name: _needed(f"gestures: {name}", needed, len(begins)) for name, needed in own.items()},
        tap=_needed("tap", [found["tap"]], 1)[0],
    )


def _needed(key: str, found: Any, length: int) -> Needed:
    if not isinstance(found, list) or len(found) != length:
        raise ValueError(f"{key}: expected a list of {length} confidences, one for each stretch, found {_brief(found)}")
    if not all(value is None or (_is_number(value) and 0 <= value <= 1) for value in found):
        raise ValueError(f"{key}: expected confidences from 0 to 1, or null for never, found {_brief(found)}")
    return tuple(None if value is None else float(value) for value in found)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MOST_S


def _brief(value: object) -> str:
    return repr(value)[:60]
