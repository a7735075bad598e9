"""What a client asks to hear: a filter, or an error that says what was expected."""

import json
from dataclasses import replace

import pytest

from gestured.core.errors import ProtocolError
from gestured.core.events import Gesture, Onset, Place, Release, Status, Where
from gestured.core.messages import MAX_LINE, Subscription, error_json, parse_subscription

GESTURE = Gesture("armrest", 41, "swipe_up", 0.98, 17, 10.0, 10.5, 10.6, 12, 0, "cnn_lstm", False, {"swipe_up": 1.0})

KNOWN = {"gestures": ("swipe_up", "circle"), "zones": ("volume",)}


def request(**wanted: object) -> bytes:
    return json.dumps({"subscribe": wanted}).encode()


def test_what_is_left_out_is_no_filter() -> None:
    default = parse_subscription(request(), KNOWN)
    assert default == Subscription()
    assert default.matches(GESTURE) and not default.matches(Onset("armrest", 1, 0.0))


def test_subscriptions_filter() -> None:
    chosen = parse_subscription(
        request(types=["gesture", "onset", "status"], sensors=["armrest"], gestures=["swipe_up"]) + b"\r\n", KNOWN
    )
    assert chosen.matches(GESTURE) and chosen.matches(Onset("armrest", 1, 0.0))
    assert not chosen.costly and parse_subscription(request(types=["provisional"]), KNOWN).costly
    assert chosen.matches(Status("ok", {}, "m", 1.0))
    assert not chosen.matches(Onset("door", 1, 0.0))
    assert not chosen.matches(Release("armrest", 1, 0.0))
    assert not parse_subscription(request(gestures=["circle"]), KNOWN).matches(GESTURE)
    assert not parse_subscription(request(types=[]), KNOWN).matches(GESTURE)


def test_a_zone_is_asked_for_where_something_has_a_place() -> None:
    chosen = parse_subscription(request(types=["gesture", "onset"], zones=["volume"]), KNOWN)
    begun = Where(Place(0, 0), Place(1, 1), 1.4, 200.0, 40.0, 1, 0)
    assert chosen.matches(replace(GESTURE, where=replace(begun, zone="volume")))
    assert not chosen.matches(replace(GESTURE, where=begun)) and not chosen.matches(GESTURE)
    assert chosen.matches(Onset("armrest", 1, 0.0))  # nobody knows yet where it began
    with pytest.raises(ProtocolError, match="expected none, since no zones are configured"):
        parse_subscription(request(zones=["volume"]), {"gestures": ("circle",), "zones": ()})


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (b"", "JSON"),
        (b"\xff", "UTF-8"),
        (b"[" * 4000, "JSON"),
        (b" " * (MAX_LINE + 1), str(MAX_LINE)),
        (b"[]", '"subscribe"'),
        (b"{}", '"subscribe"'),
        (b'{"subscribe":[]}', '"subscribe"'),
        (b'{"subscribe":{},"x":1}', '"subscribe"'),
        (request(type=["gesture"]), '"type", expected types, sensors, gestures or zones'),
        (request(types="gesture"), "subscribe.types: expected a list of strings"),
        (request(gestures=[1]), "subscribe.gestures: expected a list of strings"),
        (request(sensors=None), "subscribe.sensors: expected a list of strings"),
        (request(types=["tap"]), '"tap", expected any of onset, provisional, gesture'),
        (request(gestures=["swipe_up", "zigzag"]), '"zigzag", expected any of swipe_up, circle'),
        (request(zones=["volum"]), '"volum", expected any of volume'),
        (request(sensors=["a b"]), '"a b" cannot be a sensor'),
        (b'{"subscribe":{"types":' + b"[" * 300 + b"]" * 300 + b"}}", "subscribe.types: expected a list of strings"),
    ],
)
def test_requests_that_are_none_are_answered_with_what_was_expected(line: bytes, says: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        parse_subscription(line, KNOWN)
    assert caught.value.reason == "subscription" and says in str(caught.value)
    json.loads(error_json(str(caught.value)))
