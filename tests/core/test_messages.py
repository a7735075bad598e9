"""Events as JSON lines, and the other lines that a client is told."""

import json
import math
import typing
from collections.abc import Mapping
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.core import events, messages
from gestured.core.events import Event, Gesture, Onset, Place, Status, Where

word = st.text(min_size=1, max_size=12)
number = st.floats(-1e6, 1e6)
PLACES = st.builds(Place, st.floats(0, 1), st.floats(0, 1))
BY_TYPE: dict[object, st.SearchStrategy] = {
    str: word,
    int: st.integers(0, 2**31 - 1),
    float: number,
    bool: st.booleans(),
    str | None: st.none() | word,
    bool | None: st.none() | st.booleans(),
    float | None: st.none() | number,
    tuple[str, ...]: st.lists(word).map(tuple),
    Mapping[str, Mapping[str, typing.Any]]: st.dictionaries(word, st.dictionaries(word, number)),
    Where | None: st.none()
    | st.builds(Where, PLACES, PLACES, number, number, number, st.integers(1, 2), st.integers(0, 9), st.none() | word),
    Mapping[str, float]: st.dictionaries(word, number),
    Mapping[str, str]: st.dictionaries(word, word),
}


def any_event(cls: type) -> st.SearchStrategy:
    hints = typing.get_type_hints(cls)
    return st.builds(cls, **{f.name: BY_TYPE[hints[f.name]] for f in fields(cls)})


@given(st.one_of([any_event(cls) for cls in get_args(Event)]), st.floats(0, 2e9))
def test_every_event_survives_its_json_line(event: Event, epoch: float) -> None:
    line = messages.to_json(event, epoch)
    assert line.endswith(b"\n") and line.count(b"\n") == 1
    got = json.loads(line)
    assert getattr(events, got.pop("type").capitalize()) is type(event)
    for key in ("closed", "gates"):
        if isinstance(got.get(key), list):
            got[key] = tuple(got[key])
    for key in ("onset", "offset", "decided", "since", "until", "t"):
        if got.get(key) is not None:
            assert got[key] == getattr(event, key) + epoch
            got[key] = getattr(event, key)
    if (where := got.get("where")) is not None:
        got["where"] = Where(**where | {end: Place(**where[end]) for end in ("start", "end")})
    assert type(event)(**got) == event


GESTURE = Gesture(
    "armrest", 41, "swipe_up", 0.98, 17, 10.0, 10.5, 10.6, 12, 0, "cnn_lstm", False,
    MappingProxyType[str, Any]({"swipe_up": np.float32(0.5), "circle": 0.5}),
)  # fmt: skip


def test_a_gesture_looks_as_the_contract_says() -> None:
    assert messages.to_json(GESTURE, 1000.0) == (
        b'{"type":"gesture","sensor":"armrest","id":41,"gesture":"swipe_up","confidence":0.98,"sequence":17,'
        b'"onset":1010.0,"offset":1010.5,"decided":1010.6,"frames":12,"lost":0,"model":"cnn_lstm",'
        b'"degraded":false,"scores":{"swipe_up":0.5,"circle":0.5},"provisional":null}\n'
    )
    where = Where(Place(0.21, 0.5), Place(0.84, 0.52), 0.64, 212.0, 31.5, 1, 0, "volume")
    assert messages.to_json(replace(GESTURE, where=where), 1000.0).endswith(
        b'"provisional":null,"where":{"start":{"x":0.21,"y":0.5},"end":{"x":0.84,"y":0.52},"way":0.64,'
        b'"pressure":212.0,"snr":31.5,"contacts":1,"bridged":0,"zone":"volume"}}\n'
    )
    status = Status("ok", {"armrest": "ok"}, "cnn_lstm", 1234.5)
    assert messages.to_json(status, 1000.0) == (
        b'{"type":"status","state":"ok","sensors":{"armrest":"ok"},"model":"cnn_lstm","time":1234.5,"gates":{}}\n'
    )
    hello = {"version": "0.1", "instance": "x", "model": "m", "gestures": ("a", "b"), "sensors": {"armrest": 17}}
    assert messages.hello_json(**hello, gates={}) == (
        b'{"type":"hello","protocol":1,"version":"0.1","instance":"x","model":"m","gestures":["a","b"],'
        b'"sensors":{"armrest":17},"gates":{}}\n'
    )
    assert messages.lost_json(3) == b'{"type":"lost","count":3}\n'
    assert json.loads(messages.error_json('odd "ä"\n')) == {"type": "error", "reason": 'odd "ä"\n'}


@pytest.mark.parametrize("value", [math.nan, math.inf, np.float32("nan")])
def test_no_nan_leaves_the_house(value: float) -> None:
    with pytest.raises(ValueError):
        messages.to_json(Onset("s", 1, value), 0.0)
    with pytest.raises(ValueError):
        messages.to_json(Status("ok", {"s": value}, "m", 1.0), 0.0)  # type: ignore[dict-item]
