"""The check that a daemon's line has the fields of the protocol: a peer may have a bug, or be no daemon at all."""

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from typing import Any, get_args, get_type_hints

from gestured.core.events import Event, Place, Where
from gestured.core.messages import STREAM_TIMES, quoted

LARGEST = 1e300  # of all numbers, since counts of a sensor may be very large
LONGEST_S = 6e10  # s from 1970, the most for a time in a line: some 1900 years, which Python's calendar can still show
TIMES = STREAM_TIMES | {"time"}


def _is(*types: type) -> Callable[[Any], bool]:
    return lambda value: type(value) in types


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < LARGEST  # false for NaN and infinities


def _object(of: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, dict) and all(map(of, value.values()))


def _is_texts(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is(str), value))


def _like(what: type) -> Callable[[Any], bool]:
    kinds = get_type_hints(what)
    return lambda value: (
        isinstance(value, dict) and all(_KINDS[kind][0](value.get(name)) for name, kind in kinds.items())
    )


def _is_gates(value: Any) -> bool:
    """Whether a value says of a sensor which gates are closed, whether it is armed, and until when."""
    if not isinstance(value, dict) or not _is_texts(value.get("closed", [])):
        return False
    until = value.get("until")
    return type(value.get("armed")) in (bool, type(None)) and (
        until is None or (_is_number(until) and abs(until) < LONGEST_S)
    )


GATES = Mapping[str, Mapping[str, Any]]
# The annotation of a field -> whether a value fits it, and the words for such a value.
_KINDS: dict[Any, tuple[Callable[[Any], bool], str]] = {
    str: (_is(str), "a text"),
    int: (_is(int), "a whole number"),
    float: (_is_number, "a number"),
    bool: (_is(bool), "true or false"),
    str | None: (_is(str, type(None)), "a text or null"),
    bool | None: (_is(bool, type(None)), "true, false or null"),
    float | None: (lambda value: value is None or _is_number(value), "a number or null"),
    Place: (_like(Place), "an object with x and y"),
    Where | None: (_like(Where), "an object with start, end, way, pressure, snr, contacts, bridged and zone"),
    list[str]: (_is_texts, "a list of texts"),
    tuple[str, ...]: (_is_texts, "a list of texts"),
    Mapping[str, float]: (_object(_is_number), "an object of numbers"),
    Mapping[str, str]: (_object(_is(str)), "an object of texts"),
    GATES: (_object(_is_gates), "an object of objects with armed, closed and until"),
    Mapping[str, int]: (_object(_is(int)), "an object of whole numbers"),
}
_ANY: dict[str, Any] = {"type": str, "sensor": str} | dict.fromkeys(sorted(TIMES), float | None)  # of any
_EVENTS = {event.__name__.lower(): event for event in get_args(Event)}
# Type of a line -> its fields, each with its annotation.
_FIELDS: dict[str, dict[str, Any]] = {name: get_type_hints(event) for name, event in _EVENTS.items()} | {
    "hello": dict.fromkeys(("version", "instance", "model"), str)
    | {"gestures": list[str], "sensors": Mapping[str, int], "gates": GATES},
    "gestures": {"gestures": list[str]},
    "lost": {"count": int},
}
# Fields of an event that lines of an older daemon do not have.
_ADDED = {
    name: {field.name for field in fields(event) if (field.default, field.default_factory) != (MISSING, MISSING)}
    for name, event in _EVENTS.items()
} | {"hello": {"gates"}}


def wrong_field(line: Mapping[str, Any]) -> str | None:
    """What is wrong with a daemon's line, such as `decided "soon": expected a number`; None if it is sound.

    A newer daemon may say more, so unknown fields are ignored. The type, the sensor and all times are checked in a line
    of any type, even an unknown one; the times may be null.
    """
    name = line.get("type")
    known = _FIELDS.get(name, {}) if isinstance(name, str) else {}
    for key, annotation in (_ANY | known).items():
        fits, words = _KINDS[annotation]
        if key not in line:
            if key == "type" or (key in known and key not in _ADDED.get(str(name), ())):
                return f"{key} is missing: expected {words}"
        elif not fits(line[key]) or (key in TIMES and abs(line[key] or 0.0) >= LONGEST_S):
            return f"{key} {quoted(line[key])}: expected {words}"
    return None
