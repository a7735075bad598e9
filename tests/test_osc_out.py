"""OSC that goes out: byte for byte what OSC 1.0 asks for."""

import socket
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.client import osc_out
from gestured.client.sensor import Form
from gestured.core import osc
from gestured.core.address import Address
from gestured.core.events import Event, Gesture, Status
from gestured.core.frames import Frame, Touch
from gestured.daemon.metrics import Metrics
from gestured.daemon.sinks import OscSink
from tests import encoding

names = st.text("abcXYZ019_-", min_size=1, max_size=20)
words = st.text(st.characters(blacklist_characters="\0", blacklist_categories=["Cs"]), max_size=20)
argument = st.one_of(
    st.tuples(st.just("i"), st.integers(-(2**31), 2**31 - 1)),
    st.tuples(st.just("h"), st.integers(-(2**63), 2**63 - 1)),
    st.tuples(st.just("f"), st.floats(width=32, allow_nan=False)),
    st.tuples(st.just("d"), st.floats(allow_nan=False)),
    st.tuples(st.just("s"), words),
    st.tuples(st.just("b"), st.binary(min_size=1, max_size=20)),
)
touches = st.lists(st.builds(Touch, st.integers(0, 2**31 - 1), st.floats(0, 8), st.floats(0, 8)), max_size=5)


@given(names, st.lists(argument, max_size=8))
def test_a_message_is_written_as_osc_asks_for(name: str, pairs: list[Any]) -> None:
    types, args = "".join(tag for tag, _ in pairs), [value for _, value in pairs]
    assert osc_out.message(f"/{name}", types, args).dgram == encoding.message(f"/{name}", types, args)


def test_an_argument_that_its_type_tag_cannot_hold_is_refused() -> None:
    with pytest.raises(Exception, match="argument"):
        osc_out.message("/a", "i", (2**31,))
    with pytest.raises(ValueError):
        osc_out.message("/a", "ii", (1,))


moments = st.just(0.0) | st.floats(
    2**21, 2**33
)  # 1970, and from a month later to 2242: two ends of the count of seconds


@given(st.lists(st.binary(max_size=30), max_size=4), moments)
def test_a_dated_bundle_keeps_its_elements_and_the_time_to_the_last_bit(elements: list[bytes], moment: float) -> None:
    """Whatever the elements are: a tape holds what a sensor sent, be it OSC or not."""
    assert osc_out.dated(moment, *elements) == encoding.bundle(elements, moment)


def test_the_start_of_1970_is_a_time_and_not_immediately() -> None:
    (message,) = osc.decode(osc_out.dated(0.0, encoding.message("/a", "i", [1])))
    assert message.timetag == 0.0


@given(names, st.sampled_from([(1, 1), (3, 2), (9, 9)]), touches, st.integers(-(2**31), 2**40), st.data())
def test_a_frame_is_written_as_osc_asks_for(
    name: str, shape: tuple[int, int], fingers: list[Touch], counter: int, data: st.DataObject
) -> None:
    count = shape[0] * shape[1]
    flat = np.array(data.draw(st.lists(st.floats(-1e3, 1e5), min_size=count, max_size=count)))
    numbers = [v for touch in fingers[:3] for v in (touch.id, touch.x, touch.y)]
    trajectory = encoding.message(f"/{name}/trajectory", "iff" * (len(numbers) // 3), numbers)
    bytewise = np.clip(np.rint(flat), 0, 255).astype(">u1").tobytes()
    expected = {
        "floats": ("f" * count, flat),
        "ints": ("i" * count, np.rint(flat)),
        "uint16": ("b", np.clip(np.rint(flat), 0, 65535).astype(">u2").tobytes()),
        "uint8": ("b", bytewise),
        "float32": ("b", flat.astype(">f4").tobytes()),
    }
    frame = Frame(0.0, flat.reshape(shape), tuple(fingers))
    for values, (types, arg) in expected.items():
        address = f"/{name}/pressure"
        counted = encoding.message(address, "i" + types, [(counter + 2**31) % 2**32 - 2**31, arg])
        packet = Form(name, values).packet(frame, counter, 1.7e9 + 0.1)
        assert packet == encoding.bundle([counted, trajectory], 1.7e9 + 0.1)
        assert Form(name, values, plain=True).packet(frame, counter, 0.0) == encoding.message(address, types, [arg])


GESTURE = Gesture("armrest", 41, "swipe_up", 0.98, 17, 10.0, 10.5, 10.6, 12, 0, "cnn_lstm", False, {"swipe_up": 0.98})
GESTURE_OSC = (
    b"/gestured/armrest/gesture\0\0\0,sfidd\0\0swipe_up\0\0\0\0?z\xe1H\0\0\0\x11A\xd9T\xfcB\x80\0\0A\xd9T\xfcB\xa0\0\0"
)
TEST_OSC = b"#bundle\0\0\0\0\0\0\0\0\x01\0\0\0\x1c/gestured/test\0\0,s\0\0armrest\0\0\0\0H" + GESTURE_OSC


def published(event: Event, epoch: float, test: bool = False) -> bytes:
    """What the daemon's sink sends."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.bind(("127.0.0.1", 0))
        out.settimeout(10)
        sink = OscSink(Address(*out.getsockname()), Metrics())
        sink.publish(event, epoch, test=test)
        sink.close()
        return out.recv(9999)


def test_events_are_these_bytes() -> None:
    assert published(GESTURE, 1.7e9) == GESTURE_OSC
    assert published(GESTURE, 1.7e9, test=True) == TEST_OSC
    states = {"arm": "ok", "leg": "ok", "seat": "stale"}
    assert published(Status("no_data", states, "m", 1.0), 0.0) == b"/gestured/status\0\0\0\0,si\0no_data\0\0\0\0\x02"
