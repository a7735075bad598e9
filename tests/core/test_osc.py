"""Our OSC decoder against any bytes, and against what python-osc and the tests' own encoder write."""

import struct
import tracemalloc
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pythonosc.osc_bundle_builder import OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from gestured.core import osc
from gestured.core.errors import ProtocolError
from gestured.core.osc import Layouts, Message
from tests import encoding

REASONS = {"not_osc", "address", "types", "truncated", "trailing", "bundle", "oversized"}

int32 = st.integers(-(2**31), 2**31 - 1)
float32 = st.floats(width=32)
text = st.text(st.characters(blacklist_characters="\0", blacklist_categories=["Cs"]), max_size=20)
addresses = st.text(st.characters(min_codepoint=33, max_codepoint=126, blacklist_characters="#*,?[]{}"), max_size=30)
arguments = st.one_of(
    st.tuples(st.just("i"), int32),
    st.tuples(st.just("f"), float32),
    st.tuples(st.just("d"), st.floats()),
    st.tuples(st.just("h"), st.integers(-(2**63), 2**63 - 1)),
    st.tuples(st.just("s"), text),
    st.tuples(st.just("b"), st.binary(min_size=1, max_size=20)),  # python-osc knows no empty ones
)
runs = st.tuples(st.sampled_from("if"), st.integers(1, 20)).map(lambda x: [(x[0], i) for i in range(x[1])])
argument_lists = st.lists(st.one_of(arguments.map(lambda x: [x]), runs), max_size=6).map(lambda x: sum(x, []))
messages = st.tuples(addresses.map("/".__add__), argument_lists)
timetags = st.none() | st.floats(0, 2**31)


def encoded(message: tuple[str, list[Any]]) -> bytes:
    address, pairs = message
    return encoding.message(address, "".join(t for t, _ in pairs), [value for _, value in pairs])


LAYOUTS = Layouts()  # as a daemon has them: of all packets that came before


def decode(data: bytes, errors: list[ProtocolError] | None = None, layouts: Layouts = LAYOUTS) -> list[Message]:
    return osc.decode(data, errors, layouts)


def flat(args: tuple[Any, ...]) -> Iterator[Any]:
    for arg in args:
        yield from arg.tolist() if isinstance(arg, np.ndarray) else [arg]


def same(a: list[Any], b: list[Any]) -> bool:
    """Equal, NaN included."""
    return len(a) == len(b) and all(x == y or (x != x and y != y) for x, y in zip(a, b, strict=True))


sizes = st.integers(-(2**31), 2**31 - 1) | st.integers(-8, 64)
bundles = st.lists(sizes.map(lambda size: b"#bundle\0" + bytes(8) + struct.pack(">i", size)), max_size=12).map(b"".join)


@given(st.just(b"") | bundles, st.binary(max_size=200))
@example(b"", b"#bundle\0")
@example(b"", b"#bundle\0" + bytes(8) + struct.pack(">i", -4))  # python-osc loops for ever
@example(b"", b"/a\0\0,b\0\0\xff\xff\xff\xff")
@example(b"", b"/\xff\0\0,\0\0\0")
@example(b"", b"/a\0\0,s\0\0\xff\0\0\0")
def test_any_bytes_decode_or_raise_protocol_error(begin: bytes, rest: bytes) -> None:
    """Rubbish, alone and behind heads of bundles of any sizes."""
    data = begin + rest
    first: list[Any] | str
    try:
        first = [m.types for m in decode(data)]
    except ProtocolError as error:
        assert error.reason in REASONS
        first = error.reason
    errors: list[ProtocolError] = []
    kept = decode(data, errors)  # never raises, and says the same
    assert first == (errors[0].reason if errors else [m.types for m in kept])


@given(messages)
def test_a_message_comes_back_as_it_was_sent(message: tuple[str, list[Any]]) -> None:
    for _ in range(2):  # the second time its layout is known
        (got,) = decode(encoded(message))
        assert (got.address, got.types) == (message[0], "".join(t for t, _ in message[1]))
        assert same(list(flat(got.args)), [value for _, value in message[1]])
        assert got.timetag is None and got.bundle == -1


@given(st.lists(st.lists(messages, max_size=3), max_size=4), st.lists(timetags, min_size=5, max_size=5))
def test_bundles_are_flattened_in_order_with_their_own_time_tags(inner: list[Any], tags: list[float]) -> None:
    tail = ("/tail", [("i", 1)])
    nested = [encoding.bundle([encoded(m) for m in part], tags[i]) for i, part in enumerate(inner)]
    packet = encoding.bundle([*nested, encoded(tail)], tags[4])
    for _ in range(2):
        got = decode(packet)
        sent = [(m[0], tags[i], i + 1) for i, part in enumerate(inner) for m in part] + [("/tail", tags[4], 0)]
        assert [m.address for m in got] == [address for address, _, _ in sent]
        assert [m.bundle for m in got] == [number for _, _, number in sent]
        for message, (_, tag, _) in zip(got, sent, strict=True):
            assert message.timetag == (None if tag is None else pytest.approx(tag, abs=1e-6))


@given(st.lists(messages, min_size=1, max_size=3), st.floats(1, 2_085_978_000))
def test_we_read_what_python_osc_builds(several: list[Any], timetag: float) -> None:
    bundle = OscBundleBuilder(timetag)
    for address, pairs in several:
        builder = OscMessageBuilder(address)
        for tag, value in pairs:
            builder.add_arg(value, tag)
        bundle.add_content(builder.build())
        (alone,) = decode(builder.build().dgram)
        assert alone.address == address and same(list(flat(alone.args)), [value for _, value in pairs])
    built = bundle.build()
    got = decode(built.dgram)
    assert [m.address for m in got] == [m[0] for m in several]
    assert got[0].timetag == pytest.approx(timetag, abs=1e-6)


def test_a_buffer_that_is_used_again_does_not_change_a_message() -> None:
    buffer = bytearray(encoding.message("/s/pressure", "ffff", (np.arange(4.0),)))
    (message,) = decode(memoryview(buffer))  # type: ignore[arg-type]
    buffer[:] = bytes(len(buffer))
    assert list(flat(message.args)) == [0, 1, 2, 3]


def test_the_same_head_with_other_sizes_is_read_anew() -> None:
    for size in (0, 3, 4, 8, 1):
        (message,) = decode(encoding.message("/s", "ib", (1, bytes(size))))
        assert message.args == (1, bytes(size))
    for size in (5, 8, 7, 5):  # packets of one length, and a head so long that it alone is looked up
        (message,) = decode(encoding.message("/a-sensor-with-a-long-name/pressure", "ib", (1, bytes(size))))
        assert message.args == (1, bytes(size))
    long = encoding.message("/s/pressure", "ffff", (np.arange(4.0),))
    decode(long)
    for packet, reason in ((long[:-4], "truncated"), (long + bytes(4), "trailing")):
        with pytest.raises(ProtocolError) as caught:
            decode(packet)
        assert caught.value.reason == reason


def test_known_layouts_do_not_mix_up_sensors_and_a_thousand_of_them_are_known() -> None:
    for n in range(3000):
        (message,) = decode(encoding.message(f"/s{n % 1000}/pressure", "ffff", (np.full(4, n),)))
        assert message.address == f"/s{n % 1000}/pressure" and list(flat(message.args)) == [n] * 4
    assert len(LAYOUTS) >= 1000


@pytest.mark.parametrize("name", ["s", "a-sensor-whose-name-is-longer-than-that"])
@pytest.mark.parametrize("types", ["b", "ib", "iiiii", "iff"])
@pytest.mark.parametrize("bundled", [False, True])
def test_a_sensor_has_one_layout_whatever_it_counts_and_feels(name: str, types: str, bundled: bool) -> None:
    known = Layouts()
    for n in range(300):
        args = [bytes([n % 256] * 9) if tag == "b" else n for tag in types]
        message = encoding.message(f"/{name}/pressure", types, args)
        decode(encoding.bundle([message], n) if bundled else message, layouts=known)
    assert len(known) == 1


INVENTED = {  # packets that nobody has sent before
    "an address": lambda n: encoding.message(f"/{n}" + "x" * 240, "b", (b"x",)),
    "an array": lambda n: encoding.message(f"/{n}", "i" * 4000, (np.arange(4000),)),
    "scalars": lambda n: encoding.message(f"/{n}", "if" * 200, [1, 1.0] * 200),
    "fingers": lambda n: encoding.message(f"/{n}", "iff" * 3, [1, 1.0, 1.0] * 3),
    "messages": lambda n: encoding.bundle([encoding.message(f"/{n}", "f", (1.0,))] * 200),
}


@pytest.mark.parametrize("kind", INVENTED)
def test_invented_layouts_take_no_more_memory_than_was_given_to_them(kind: str) -> None:
    given = 1 << 20
    known = Layouts(given)
    held = 0
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for n in range(1500):
            decode(INVENTED[kind](n), layouts=known)
            held = max(held, tracemalloc.get_traced_memory()[0] - before)
            if n and len(known) == 1:  # they were forgotten
                break
        else:
            pytest.fail("not enough of them")
    finally:
        tracemalloc.stop()
    assert held <= given


@pytest.mark.parametrize(
    ("packet", "reason"),
    [
        (b"hello", "not_osc"),
        (b"/a\0\0", "types"),
        (b"/a\0\0,i\0", "truncated"),
        (b"/a\0\0,f\0\0\0\0", "truncated"),
        (b"/a\0\0,\0\0\0\0\0\0\0", "trailing"),
        (b"/a\0\0,Z\0\0", "types"),
        (b"/\xe4\0\0,\0\0\0", "address"),
        (b"/" + b"a" * 300 + b"\0\0\0,\0\0\0", "address"),
        (b"/a\0\0,s\0\0\xff\0\0\0", "types"),
        (b"/a\0\0,s\0\0abcd", "truncated"),
        (b"/a\0\0,b\0\0\0\0\0\x08abcd", "truncated"),
        (b"#bundle\0\0\0\0\0", "bundle"),
        (b"#bundle\0" + bytes(8) + b"\0\0\0\0", "bundle"),
        (b"#bundle\0" + bytes(8) + b"\0\0", "bundle"),
        (b"/a\0\0," + b"f" * 5003 + bytes(4 * 5003), "oversized"),
        (b"/a\0\0" + bytes(70_000), "oversized"),
    ],
)
def test_each_fault_has_its_reason(packet: bytes, reason: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        decode(packet)
    assert caught.value.reason == reason


def test_depth_and_number_are_bounded() -> None:
    nested = encoded(("/a", []))
    for depth in range(1, 2000):
        nested = encoding.bundle([nested])
        if depth == osc.MAX_DEPTH:
            assert len(decode(nested)) == 1
    with pytest.raises(ProtocolError, match="deeper"):
        decode(nested)
    many = [encoded(("/a", []))] * (osc.MAX_MESSAGES + 1)
    assert len(decode(encoding.bundle(many[1:]))) == osc.MAX_MESSAGES
    with pytest.raises(ProtocolError, match="more than"):
        decode(encoding.bundle(many))
    errors: list[ProtocolError] = []
    decode(encoding.bundle([b"/\0\0\0"] * 8000), errors)
    assert len(errors) == osc.MAX_MESSAGES + 1
