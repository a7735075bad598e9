"""Bytes of serial lines to frames: whatever comes between frames, and however it is cut."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_message_builder import OscMessageBuilder

from gestured.bridge.protocols import PROTOCOLS, looks_like
from gestured.bridge.readings import Protocol, Unwrapped
from gestured.client.sensor import Form
from gestured.core.frames import Frame
from gestured.core.osc import decode
from gestured.core.stamping import Stamper
from gestured.core.wire import Arrival

ROOT = Path(__file__).parents[2]
ROWS, COLUMNS = 4, 5
SIZE = ROWS * COLUMNS
GRIDS = {name: each.grid if each.fixed else (ROWS, COLUMNS) for name, each in PROTOCOLS.items()}
NAMES = sorted(PROTOCOLS)


def opened(name: str) -> Protocol:
    return PROTOCOLS[name](*GRIDS[name])


def frames(name: str, count: int, seed: int = 0) -> list[np.ndarray]:
    """Counts of a byte; those of FlexiTac never hold its marker, which only another test may."""
    return [f % 170 for f in np.random.default_rng(seed).integers(0, 256, (count, *GRIDS[name]))]


def message(address: str, *arguments: object) -> bytes:
    """A message of values, or of (value, type tag)."""
    builder = OscMessageBuilder(address)
    for argument in arguments:
        builder.add_arg(*argument if isinstance(argument, tuple) else (argument,))
    return builder.build().dgram


def slip_encoded(packet: bytes) -> bytes:
    """A packet between two END bytes, byte by byte as RFC 1055 has it."""
    escaped = {0xC0: b"\xdb\xdc", 0xDB: b"\xdb\xdd"}
    return b"\xc0" + b"".join(escaped.get(byte, bytes((byte,))) for byte in packet) + b"\xc0"


def written(name: str, frame: np.ndarray) -> bytes:
    """A frame as a sensor says it."""
    data = frame.astype(np.uint8).tobytes()
    match name:
        case "flexitac":
            return b"\xaa\x55" + data
        case "e256":
            return slip_encoded(message("/r", data))
        case "osc-slip":
            return slip_encoded(message("/any/thing", *map(float, frame.ravel())))
        case _:
            return ",".join(map(str, frame.ravel())).encode() + b"\r\n"


def before(name: str) -> bytes:
    """The end of a line that was being said when we came."""
    return b"7\n" if name == "csv" else b""


def heard(protocol: Protocol, *chunks: bytes) -> list[np.ndarray]:
    """The frames of these bytes, and then silence."""
    return [each.values for chunk in chunks for each in protocol.push(chunk)] + [r.values for r in protocol.flush()]


def same(found: list[np.ndarray], expected: list[np.ndarray]) -> bool:
    return len(found) == len(expected) and all(np.array_equal(a, b) for a, b in zip(found, expected, strict=True))


@pytest.mark.parametrize("name", NAMES)
@given(cuts=st.lists(st.integers(1, 60), max_size=40))
def test_frames_are_whole_however_the_bytes_are_cut(name: str, cuts: list[int]):
    sent = frames(name, 5)
    data = before(name) + b"".join(written(name, frame) for frame in sent)
    chunks = []
    for cut in cuts:
        chunks.append(data[:cut])
        data = data[cut:]
    protocol = opened(name)
    assert same(heard(protocol, *chunks, data), sent)
    assert protocol.passed == 0 or name == "csv"


@pytest.mark.parametrize("name", NAMES)
@given(garbage=st.binary(min_size=1, max_size=400), cut=st.integers(0, 10_000))
def test_after_garbage_it_is_in_step_within_one_frame(name: str, garbage: bytes, cut: int):
    """Bytes are put in, or a frame is cut short: at most the frame that is hit and its neighbours are missing."""
    sent = frames(name, 8)
    whole = [written(name, frame) for frame in sent]
    third = whole[3]
    whole[3] = third[: cut % len(third)] + garbage
    found = heard(opened(name), before(name), *whole)
    assert same(found[:2], sent[:2])
    assert same(found[-3:], sent[5:])


@pytest.mark.parametrize("name", NAMES)
@given(cut=st.integers(1, 10_000))
def test_a_frame_that_lost_bytes_is_never_given(name: str, cut: int):
    sent = frames(name, 6)
    whole = [written(name, frame) for frame in sent]
    if name == "csv":  # a line has no sum: only what changes how many numbers it has is noticed
        whole[2] = whole[2].split(b",", 1)[1]
    else:
        whole[2] = whole[2][: cut % (len(whole[2]) - 1)]
    found = heard(opened(name), before(name), *whole)
    known = {frame.tobytes() for frame in np.array(sent, dtype=float)}
    assert len(found) >= 4 and all(frame.astype(float).tobytes() in known for frame in found)


@pytest.mark.parametrize("name", NAMES)
@given(data=st.lists(st.binary(max_size=300), max_size=10))
def test_any_bytes_give_frames_of_the_grid_or_nothing(name: str, data: list[bytes]):
    for frame in heard(opened(name), *data):
        assert frame.shape == GRIDS[name] and np.isfinite(frame).all()
    assert looks_like(b"".join(data)) is None or isinstance(looks_like(b"".join(data)), str)


def test_a_marker_within_the_data_is_none():
    sent = frames("flexitac", 6)
    for n, frame in enumerate(sent):
        frame.ravel()[n : n + 2] = 0xAA, 0x55
    assert same(heard(opened("flexitac"), b"".join(written("flexitac", frame) for frame in sent)), sent)
    cut = b"".join(written("flexitac", frame) for frame in sent)[3:]  # and where the first frame is not whole
    assert same(heard(opened("flexitac"), cut), sent[1:])


def test_a_line_without_an_end_takes_no_memory():
    for name in ("csv", "e256", "osc-slip"):
        protocol = opened(name)
        for _ in range(100):
            protocol.push(bytes(range(1, 9)) * 1000)
        assert protocol.passed > 600_000
        assert same(
            heard(protocol, b"\n" if name == "csv" else b"\xc0", written(name, frames(name, 1)[0])), frames(name, 1)
        )


def test_forms_of_osc():
    protocol = opened("osc-slip")
    values = frames("osc-slip", 1)[0]
    packets = {
        "floats": message("/x", *map(float, values.ravel())),
        "ints": message("/x", *map(int, values.ravel())),
        "counted": message("/x", 7, *map(float, values.ravel())),
        "counted ints": message("/x", 7, *map(int, values.ravel())),
        "blob of bytes": message("/x", values.astype(np.uint8).tobytes()),
        "blob of uint16": message("/x", values.astype(">u2").tobytes()),
        "counted blob": message("/x", 7, values.astype(">f4").tobytes()),
    }
    for name, packet in packets.items():
        (reading,) = protocol.push(slip_encoded(packet))
        assert np.array_equal(reading.values, values), name
        assert reading.counter == (7 if "counted" in name else None), name
    assert protocol.push(slip_encoded(message("/x", "text")) + slip_encoded(message("/x", *range(6)))) == []


def test_what_stands_before_the_numbers_is_no_taxel():
    protocol = opened("osc-slip")
    numbers = list(map(float, range(SIZE)))
    too_few = [
        message("/x", before, *numbers[1:]) for before in ("text", b"blob", (2**62, "h"), (1e300, "d"), (0, "i"))
    ]
    too_many = [message("/x", 1, "text", *numbers), message("/x", 1, 2, *numbers), message("/x", "text", *numbers)]
    for packet in too_few + too_many:
        assert protocol.push(slip_encoded(packet)) == []
    for before in ((7, "h"), (7.0, "d"), 7):
        (reading,) = protocol.push(slip_encoded(message("/x", before, *numbers)))
        assert reading.counter == 7 and np.array_equal(reading.values.ravel(), numbers)


def test_a_number_before_a_line_counts_frames():
    line = "12; " + "; ".join(["0.5"] * SIZE) + "\n"
    (reading,) = opened("csv").push(b"\n" + line.encode())
    assert reading.counter == 12 and (reading.values == 0.5).all()
    for counter in ("nan", "inf", "1.5"):
        assert opened("csv").push(b"\n" + line.replace("12", counter, 1).encode()) == []


@pytest.mark.parametrize("name", NAMES)
def test_bytes_look_like_what_they_are(name: str):
    data = b"".join(written(name, frame) for frame in frames(name, 6))
    words = looks_like(data[3:])
    assert words is not None and words.startswith(name)
    if not PROTOCOLS[name].fixed:
        assert str(SIZE) in words


def test_osc_that_holds_no_frame_is_described_as_it_is():
    doubles = looks_like(3 * slip_encoded(message("/x", *((1.0, "d") for _ in range(SIZE)))))
    assert doubles == "osc-slip with messages to /x of 20 numbers or bytes, type tags dddd"
    blobs = looks_like(3 * slip_encoded(message("/x", 7, bytes(162))))
    assert blobs == "osc-slip with messages to /x of 163 numbers or bytes, type tags ib"


def test_noise_looks_like_nothing():
    noise = np.random.default_rng(1).integers(0, 256, 20_000).astype(np.uint8).tobytes()
    assert looks_like(noise) is None
    assert looks_like(bytes(20_000)) is None


@pytest.mark.parametrize("bits", [8, 16, 32])
@given(lost=st.sets(st.integers(0, 80)), first=st.integers(-40, 0))
def test_a_counter_that_overflows_is_no_sensor_that_began_anew(bits: int, lost: set[int], first: int):
    """At most some of the frames around the overflow are lost; the daemon's own stamper says how many."""
    own, stamper, before, form = Unwrapped(), Stamper(), None, Form("pad")
    kept = [n for n in range(81) if n not in lost or n % 8 == 0]
    for n in kept:
        packet = form.packet(Frame(0.0, np.zeros((2, 2))), own.of((first + n) % 2**bits), 0.0)
        counter = decode(packet)[0].args[0]
        (stamp,) = stamper.stamp([Arrival("pad", np.zeros((2, 2)), counter, None, ())], n / 15)
        assert not stamp.restarted and not stamp.dropped and stamp.lost == (0 if before is None else n - before - 1)
        before = n


@pytest.mark.parametrize(("last", "then"), [(100, 0), (200, 3), (300, 0), (40_000, 1), (70_000, 2)])
def test_a_counter_that_falls_elsewhere_began_anew(last: int, then: int):
    own = Unwrapped()
    assert own.of(last) - own.of(then) == last - then


@pytest.mark.parametrize("name", NAMES)
def test_the_documents_say_what_each_is(name: str):
    assert f"| `{name}` |" in (ROOT / "docs" / "connect.md").read_text()


def csv_line(n: int, counted: bool) -> bytes:
    return b" ".join([*([b"%d" % n] if counted else []), *[b"100"] * 16]) + b"\n"


@pytest.mark.parametrize("counted", [True, False])
def test_a_csv_line_that_is_off_by_one_number_is_no_frame(counted: bool) -> None:
    old, new = (b"100 100\n", b"100100\n") if counted else (b"100\n", b"10 0\n")
    lines = [csv_line(n, counted) for n in range(8)]
    damaged = lines[4].removesuffix(old) + new
    csv = PROTOCOLS["csv"](4, 4)
    readings = csv.push(b"\n" + b"".join([*lines[:4], damaged, *lines[5:]]))
    assert [reading.counter for reading in readings] == [n if counted else None for n in (0, 1, 2, 3, 5, 6, 7)]
    assert all((reading.values == 100).all() for reading in readings) and csv.passed == len(damaged.strip())


def test_a_csv_sensor_that_goes_on_with_a_counter_is_believed() -> None:
    csv = PROTOCOLS["csv"](4, 4)
    lines = [csv_line(n, counted) for n, counted in enumerate([False] * 3 + [True] * 5)]
    readings = csv.push(b"\n" + b"".join(lines))
    assert [reading.counter for reading in readings] == [None] * 3 + [5, 6, 7]


@pytest.mark.parametrize("number", [b"1e39", b"-1e300", b"inf", b"nan"])
def test_a_csv_number_that_no_frame_can_hold_is_in_none(number: bytes) -> None:
    csv = PROTOCOLS["csv"](4, 4)
    assert csv.push(b"\n" + csv_line(0, False).replace(b"100", number, 1)) == []
    assert csv.passed > 0
