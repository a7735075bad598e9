"""The headers for C and C++: they compile without a warning, and a frame's bytes are the simulated sensor's."""

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import gestured
from gestured.bridge.protocols import Csv
from gestured.bridge.slip import OscSlip
from gestured.client.sensor import Form
from tests.deploy.compilers import CPP, HEADERS, HERE, C, compiled

KINDS = {"uint8": np.uint8, "uint16": np.uint16, "floats": np.float32}
ROOM = 64 * 64 * 8 + 256  # bytes of the longest form: floats of which each byte is escaped
COMPILERS = {
    "gcc": ("gcc", C), "g++": ("g++", CPP), "clang": ("clang", C), "clang++": ("clang++", CPP),
    "avr-gcc": ("avr-gcc", C, "-mmcu=atmega328p"), "avr-g++": ("avr-g++", CPP, "-mmcu=atmega328p"),
    "arm-none-eabi-gcc": ("arm-none-eabi-gcc", C, "-mcpu=cortex-m0", "-mthumb"),
}  # fmt: skip


@pytest.mark.parametrize("name", COMPILERS)
def test_frames_compile_without_a_warning(name: str, tmp_path: Path):
    compiler, standard, *flags = COMPILERS[name]
    language = "c++" if standard == CPP else "c"
    compiled(compiler, standard, tmp_path / "frames.o", *flags, "-c", "-x", language, HERE / "frames.c")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., bytes]:
    """What the header makes of a frame."""
    out = tmp_path_factory.mktemp("c") / "frames.so"
    library = ctypes.CDLL(str(compiled("gcc", C, out, "-shared", "-fPIC", HERE / "frames.c")))
    library.written.restype = ctypes.c_size_t

    def write(form: str, sensor: str, values: Any, counter: int | None = None, room: int = ROOM) -> bytes:
        kind = [np.dtype(each) for each in KINDS.values()].index(values.dtype)
        buffer = ctypes.create_string_buffer(room + 1)
        number = ctypes.c_int64(-1 if counter is None else counter % 2**32)
        data = values.tobytes() or b"\0"
        count = library.written(
            ctypes.c_char(form.encode()), sensor.encode(), kind, data, ctypes.c_uint16(values.size), number,
            buffer, ctypes.c_size_t(room),
        )  # fmt: skip
        assert count <= room and buffer.raw[count:] == bytes(room + 1 - count), "it wrote more than it said"
        return buffer.raw[:count]

    return write


names = st.text("abcXYZ019_-", min_size=1, max_size=64)
counters = st.none() | st.integers(-(2**31), 2**31 - 1)
shapes = st.tuples(st.integers(1, 16), st.integers(1, 16)) | st.just((64, 64))
bits = {"uint8": st.integers(0, 255), "uint16": st.integers(0, 65535), "floats": st.floats(width=32, allow_nan=False)}


@st.composite
def frames(draw: st.DrawFn, kinds: tuple[str, ...] = tuple(KINDS)) -> tuple[str, Any]:
    kind = draw(st.sampled_from(kinds))
    return kind, draw(arrays(KINDS[kind], draw(shapes), elements=bits[kind]))


@given(names, frames(), counters)
def test_a_frame_has_the_bytes_of_the_simulated_sensor(written, name: str, frame: tuple[str, Any], counter):
    kind, values = frame
    expected = Form(name, kind)._pressure(values, counter)
    assert written("o", name, values, counter) == expected
    assert written("p", name, values, counter, len(expected)) == expected
    assert written("p", name, values, counter, len(expected) - 1) == b""  # no room: nothing is half written


@given(names, st.lists(frames(("uint8", "uint16")), min_size=2, max_size=4), st.integers(0, 2**31 - 1))
def test_what_goes_out_on_a_serial_line_is_what_the_bridge_reads(written, name: str, sent: list[Any], counter: int):
    for form, protocol, noise in (("s", OscSlip, b"half a packet"), ("l", Csv, b"half a line\n")):
        for kind, values in sent:
            if values.size < 2:  # a blob of one byte, or a line of one number
                continue
            reader = protocol(*values.shape)
            (reading,) = reader.push(noise + written(form, name, values, counter))
            assert reading.counter == counter and (reading.values == values).all()
            assert kind in str(reading.values.dtype) or form == "l"


def test_slip_escapes_what_ends_a_packet(written):
    values = np.array([[0xC0, 0xDB, 0xDC, 0xDD]], np.uint8)
    packet = written("o", "a", values)
    assert (
        written("s", "a", values)
        == b"\xc0" + packet.replace(b"\xdb", b"\xdb\xdd").replace(b"\xc0", b"\xdb\xdc") + b"\xc0"
    )


@pytest.mark.parametrize("form", "ospl")
@pytest.mark.parametrize("name", ["", "x" * 65, "arm rest", "arm/rest", "é"])
def test_a_name_that_no_daemon_takes_is_not_sent(written, form: str, name: str):
    assert written(form, name, np.zeros((2, 2), np.uint8)) == b""


@pytest.mark.parametrize("form", "ospl")
def test_a_frame_without_taxels_or_with_too_many_is_not_sent(written, form: str):
    assert written(form, "a", np.zeros((0, 0), np.uint8)) == b""
    assert written(form, "a", np.zeros((64, 65), np.uint8)) == b""


def test_floats_have_no_line(written):
    assert written("l", "a", np.zeros((2, 2), np.float32)) == b""


def test_the_arduino_library_names_what_there_is():
    lines = (HEADERS / "library.properties").read_text().splitlines()
    properties = dict(line.split("=", 1) for line in lines)
    assert properties["version"] == gestured.__version__
    assert (HEADERS / properties["includes"]).is_file()
