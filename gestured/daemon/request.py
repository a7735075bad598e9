"""Requests of the control socket, checked as a whole against the table of verbs, and replies; both JSON lines."""

import json
from collections.abc import Awaitable, Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from gestured.core.errors import GesturedError
from gestured.core.messages import json_object, quoted

MAX_REQUEST_BYTES = 4096  # bytes of a request

Reply = dict[str, Any]
_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False)


def json_line(reply: Reply) -> bytes:
    """A reply, or what is streamed after one, as a line of the control socket. Raises ValueError for NaN, infinity."""
    return _ENCODER.encode(reply).encode() + b"\n"


@dataclass(frozen=True, slots=True)
class ReplyStream:
    """An answer and the lines that follow it, which are made as they are read."""

    answer: Reply
    lines: Iterator[bytes]


class Refusal(GesturedError):
    """A request that is not carried out; the text is the reason."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One key of a request: its JSON type, the same in words for the refusal, and whether it must be there."""

    kind: type | tuple[type, ...]
    words: str
    required: bool = False
    check: Callable[[Any], bool] = lambda value: True


@dataclass(frozen=True, slots=True)
class Verb:
    """One verb: `run(connection, **parameters)` gives the answer or raises Refusal."""

    run: Callable[..., Awaitable[Reply | ReplyStream]]
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    changes: bool = True  # whether it changes anything, so that it is logged
    slow: bool = False  # whether it waits for another thread; quick verbs do not wait for slow ones


def parse_request(line: bytes, verbs: Mapping[str, Verb]) -> tuple[str, dict[str, Any]]:
    """(verb, parameters) of one line; raises Refusal with the key, what was found and what was expected."""
    request = json_object(line)
    if request is None or not isinstance(request.get("verb"), str):
        raise Refusal('expected one JSON object a line with a "verb", such as {"verb":"status"}')
    name = request.pop("verb")
    if name not in verbs:
        raise Refusal(f"verb: unknown {quoted(name)}, expected one of {', '.join(verbs)}")
    known = verbs[name].parameters
    for key, value in request.items():
        if key not in known:
            raise Refusal(f"{name}: unknown key {quoted(key)}, expected {', '.join(known) or 'no key'}")
        parameter = known[key]
        wrong = isinstance(value, bool) and parameter.kind is not bool
        if wrong or not isinstance(value, parameter.kind) or not parameter.check(value):
            raise Refusal(f"{name}.{key}: expected {parameter.words}, found {quoted(value)}")
    for key, parameter in known.items():
        if parameter.required and key not in request:
            raise Refusal(f"{name}.{key}: is missing, expected {parameter.words}")
    return name, request
