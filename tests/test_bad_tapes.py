"""Tapes that are small and want to be large, that say what is no event, and that name files for us to open."""

import json
import struct
import tracemalloc
from pathlib import Path
from typing import Any

import pytest

from gestured.control.cli import main
from gestured.core.errors import RecordingError
from gestured.core.facts import Dropped
from gestured.record import mcap, tape_reader
from gestured.record.replay import Mute, Replay, opened
from tests.opening import in_bounds, refused
from tests.sockets import free_address

MIB = 400  # for a file; the bombs below want a gigabyte or more
MAGIC = b"\x89MCAP0\r\n"
TABLE = {"pressure": "/{sensor}/pressure", "trajectory": "/{sensor}/trajectory"}
SETTINGS: dict[str, Any] = {
    "addresses": TABLE, "stale_s": 1.0, "grid": None, "clock": "arrival", "sensors": {}, "per_gesture": {},
    "model": "cnn_lstm", "fallback": [],
}  # fmt: skip
SCENE: dict[str, Any] = {"settings": SETTINGS, "gestures": ["one_tap"], "model": {"rows": 9, "columns": 9}}
ONSET = {"type": "onset", "sensor": "arm", "id": 1, "onset": 5.0}
TAP = {"type": "gesture", "sensor": "arm", "id": 1, "gesture": "one_tap", "confidence": 0.9, "sequence": 1,
       "onset": 5.0, "offset": 5.2, "decided": 5.3, "frames": 3, "lost": 0, "model": "m", "degraded": False,
       "scores": {}}  # fmt: skip
GATE = {"type": "gate", "sensor": "arm", "armed": None, "closed": ["door"], "until": None, "since": 0.5}


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def text(value: str) -> bytes:
    return struct.pack("<I", len(value.encode())) + value.encode()


def pairs(**values: str) -> bytes:
    inside = b"".join(text(key) + text(value) for key, value in values.items())
    return struct.pack("<I", len(inside)) + inside


def channel(number: int, topic: str, **metadata: str) -> bytes:
    return record(4, struct.pack("<HH", number, 0) + text(topic) + text("osc") + pairs(**metadata))


def message(number: int, t_ns: int, data: bytes) -> bytes:
    return record(5, struct.pack("<HIQQ", number, 0, t_ns, t_ns) + data)


def chunk(data: bytes, compression: str, size: int) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, 0) + text(compression)
    return record(6, head + struct.pack("<Q", len(data)) + data)


def packed(data: bytes, compression: str) -> bytes:
    import lz4.frame
    import zstandard

    return zstandard.compress(data) if compression == "zstd" else lz4.frame.compress(data)


START = MAGIC + record(1, text("gestured") + text("")) + record(12, text("scene") + pairs(json=json.dumps(SCENE)))
CHANNELS = channel(1, "/gestured/packets", source="127.0.0.1:5") + channel(2, "/gestured/events")
END = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC
PACKET = message(1, 10**9, bytes(1 << 16))


def write(path: Path, *inside: bytes, start: bytes = START, end: bytes = END) -> Path:
    path.write_bytes(start + b"".join(inside) + end)
    return path


def events(path: Path, *lines: object) -> Path:
    data = [line if isinstance(line, bytes) else json.dumps(line).encode() for line in lines]
    return write(path, CHANNELS, *(message(2, 10**9, line) for line in data))


def test_a_sender_may_have_an_ipv6_address(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", channel(1, "/gestured/packets", source="[fd00::7]:5"), message(1, 10**9, b""))
    assert tape_reader.read(path).packets[0].source == ("fd00::7", 5)


@pytest.mark.parametrize(
    ("packet", "said"),
    [(message(1, 2**64 - 1, b""), "packet 2: expected"), (PACKET, "cannot be sent: Message too long")],
    ids=["time", "size"],
)
def test_a_packet_that_cannot_be_sent_is_one_sentence(tmp_path: Path, capsys, packet: bytes, said: str) -> None:
    path = write(tmp_path / "a.mcap", CHANNELS, message(1, 10**9, b""), packet)
    assert main(["replay", str(path), "--to", str(free_address())]) == 1
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and said in err


def test_two_tapes_in_one_file_are_not_played_as_the_first_alone(tmp_path: Path) -> None:
    tape = write(tmp_path / "a.mcap", CHANNELS, message(1, 10**9, b""))
    (tmp_path / "b.mcap").write_bytes(2 * tape.read_bytes())
    with pytest.raises(RecordingError, match=r"b\.mcap: holds more bytes after the end of its recording"):
        tape_reader.read(tmp_path / "b.mcap")


@pytest.mark.parametrize(
    "one",
    [message(1, 10**9, bytes(1 << 16)), message(3, 10**9, bytes(1 << 16)), message(1, 10**9, b""),
     message(2, 10**9, b'{"type":"new"}')],
    ids=["packets", "pictures", "small packets", "small events"],
)  # fmt: skip
def test_what_a_tape_unpacks_to_and_what_is_kept_of_it_is_bounded(
    tmp_path: Path, one: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Thirty bytes of a file are a few hundred of this program's."""
    for name in ("GROWTH_BYTES", "GROWTH"):  # a sixteenth, which takes a sixteenth of the time
        monkeypatch.setattr(mcap, name, getattr(mcap, name) // 16)
    inside = CHANNELS + channel(3, "/arm/pressure") + one * ((1 << 20) // len(one))
    packed_inside = chunk(packed(inside, "zstd"), "zstd", len(inside))
    path = write(tmp_path / "a.mcap", *[packed_inside] * 128)
    limit = mcap.GROWTH_BYTES + mcap.GROWTH * path.stat().st_size
    tracemalloc.start()
    try:
        assert "than a recording of its size does" in refused("mcap", path)
        assert tracemalloc.get_traced_memory()[1] < 2 * limit
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("compression", ["zstd", "lz4", ""])
def test_a_chunk_unpacks_to_what_it_says(tmp_path: Path, compression: str) -> None:
    data = bytes(1 << 29) if compression else bytes(1 << 16)
    data = packed(data, compression) if compression else data
    for says in (100, 1 << 20, 1 << 40):
        write(tmp_path / f"{says}.mcap", chunk(data, compression, says))
    nothing_is_taken_from(tmp_path)


def nothing_is_taken_from(folder: Path, packets: int = 0) -> None:
    """Of none of the tapes more than so many packets, and little memory for all of them."""
    _, mib = in_bounds("mcap", folder, MIB)
    assert mib < 64
    for path in folder.iterdir():
        found = tape_reader.read(path)
        assert not found.whole and len(found.packets) == packets, path.name


LIARS = (
    record(6, struct.pack("<QQQI", 0, 0, 100, 0) + text("") + struct.pack("<Q", 1 << 40)),
    struct.pack("<BQ", 5, 1 << 40),
    record(5, b""),
    record(5, bytes(21)),
    record(4, bytes(3)),
    record(4, struct.pack("<HHI", 1, 0, 0xFFFFFFFF)),
    record(12, text("scene") + struct.pack("<I", 0xFFFFFFFF)),
    record(6, b"\xff" * 40),
    channel(1, "/gestured/packets", source="nowhere"),
    channel(1, "/gestured/packets", source="a" * 5000 + ":5"),
    message(9, 5, b"of no channel"),
)


def test_records_that_lie_about_their_sizes_end_what_is_read(tmp_path: Path) -> None:
    for number, inside in enumerate(LIARS):
        with (tmp_path / f"{number}.mcap").open("wb") as file:
            file.write(START + CHANNELS + PACKET + inside)
            file.truncate(8 << 30)  # whoever believes a size finds that much
    nothing_is_taken_from(tmp_path, packets=1)


# What else a line may not be, tests/test_fields.py says of those that a client reads.
WRONG = {
    "no object": [1],
    "no JSON": b"{",
    "nested": b'{"type":"status","x":' + b"[" * 100_000,
    "no type": {"sensor": "arm"},
    "no sensor": {k: v for k, v in ONSET.items() if k != "sensor"},
    "not finite": ONSET | {"onset": float("nan")},
    "in no year": TAP | {"onset": 1e300},
    "large": GATE | {"until": 10**400},
}


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_no_event_is_named(tmp_path: Path, kind: str) -> None:
    assert refused("mcap", events(tmp_path / "good.mcap", ONSET, TAP | {"more": [1]}, {"type": "new"})) == ""
    path = events(tmp_path / "a.mcap", ONSET, WRONG[kind])
    assert f"{path}: event 2: " in refused("mcap", path)


def test_gates_of_tens_of_thousands_of_sensors_take_no_longer_than_their_lines(tmp_path: Path) -> None:
    lines = [message(2, 10**9, json.dumps(GATE | {"sensor": f"s{k}"}).encode()) for k in range(50_000)]
    tape, made = opened(write(tmp_path / "a.mcap", CHANNELS, *lines, message(1, 10**9, b"")))
    assert list(Replay(tape, made.scene, Mute(made.scene.gestures)).events()) == []


SCENES: dict[str, dict[str, Any]] = {
    "model": {"model": 5},
    "fallback": {"fallback": 5},
    "stale": {"stale_s": 10**400},
    "never stale": {"stale_s": -1},
    "not finite": {"stale_s": float("nan")},
    "grid": {"grid": [1 << 70, 9]},
    "grid of three": {"grid": [9, 9, 9]},
    "sensors": {"sensors": [1]},
    "many sensors": {"sensors": {f"s{k}": {} for k in range(20_000)}},
    "a sensor": {"sensors": {"arm": 5}},
    "rotate": {"sensors": {"arm": {"rotate": []}}},
    "clock": {"clock": {}},
    "addresses": {"addresses": {"pressure": [], "trajectory": []}},
    "per gesture": {"per_gesture": {"one_tap": {"threshold": "x", "refractory_s": 0}}},
    "refractory": {"per_gesture": {"one_tap": {"threshold": None, "refractory_s": float("inf")}}},
}


@pytest.mark.parametrize("kind", SCENES)
def test_a_scene_that_is_none_is_named_with_its_file(tmp_path: Path, kind: str) -> None:
    scene = SCENE | {"settings": SETTINGS | SCENES[kind]}
    start = MAGIC + record(12, text("scene") + pairs(json=json.dumps(scene)))
    assert "scene: expected" in refused("mcap", write(tmp_path / "a.mcap", CHANNELS, PACKET, start=start))


ODD: tuple[dict[str, Any], ...] = (
    {"settings": None}, {"gestures": []}, {"model": {}}, {"model": {"rows": 999, "columns": 9}},
)  # fmt: skip


@pytest.mark.parametrize("said", ["", "[]", "{", "[" * 100_000, "5", *(json.dumps(SCENE | odd) for odd in ODD)])
def test_a_scene_that_is_none(tmp_path: Path, said: str) -> None:
    start = MAGIC + record(12, text("scene") + pairs(json=said))
    reason = refused("mcap", write(tmp_path / "a.mcap", start=start))
    assert "scene" in reason and "expected" in reason


@pytest.mark.parametrize("how", ["model", "fallback"])
def test_a_model_that_only_the_tape_names_is_not_opened(
    tmp_path: Path, how: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from gestured.model import shipped

    opened = []
    monkeypatch.setattr(shipped, "read_bytes", lambda path: opened.append(str(path)) or b"")
    planted = tmp_path / "planted.onnx"
    planted.write_bytes(b"")
    named = {"model": str(planted)} if how == "model" else {"model": "cnn_lstm", "fallback": [str(planted)]}
    scene = SCENE | {"settings": SETTINGS | named}
    start = MAGIC + record(12, text("scene") + pairs(json=json.dumps(scene)))
    path = write(tmp_path / "a.mcap", CHANNELS, PACKET, start=start)
    assert main(["replay", str(path)]) == 1
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and opened == []
    assert str(path) in err and str(planted) in err and "--model" in err


@pytest.mark.parametrize("host", ["localhost", "127.0.a.1", "1"])
def test_a_sender_by_name_is_in_none_of_the_networks_that_may_send(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], host: str
) -> None:
    told = SCENE | {"settings": SETTINGS | {"allow": ["127.0.0.0/8"]}}
    start = MAGIC + record(12, text("scene") + pairs(json=json.dumps(told)))
    path = write(tmp_path / "a.mcap", channel(1, "/gestured/packets", source=f"{host}:5"), PACKET, start=start)
    status = main(["replay", str(path)])
    assert status == 0, capsys.readouterr().err
    tape, made = opened(path)
    facts = list(Replay(tape, made.scene, Mute(made.scene.gestures)).facts())
    assert [fact.reason for fact in facts if isinstance(fact, Dropped)] == ["not_allowed"]
