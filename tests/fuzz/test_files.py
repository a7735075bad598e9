"""Valid files of each kind, cut off, flipped, repeated and grown: what comes of it is data, or one sentence."""

import io
import random
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.opening import KINDS, in_bounds, refused
from tests.small_recording import example, save, session

MIB = 256  # of address space for a file of some kilobytes, for all of them one after the other


def _npz(folder: Path) -> list[bytes]:
    path = folder / "seed.npz"
    return [save(path, recordings).read_bytes() for recordings in (example(), session())]


def _mcap(folder: Path) -> list[bytes]:
    from gestured.record import tape_writer
    from tests import encoding
    from tests import test_bad_tapes as tapes

    path = folder / "seed.mcap"
    packets = [encoding.message("/arm/pressure", "b", [bytes(81 * [k % 3])]) for k in range(8)]
    scene = tapes.SCENE | {"settings": tapes.SETTINGS | {"sensors": {"leg": {"rotate": 90, "clock": "sensor"}}}}
    with tape_writer.Writer(path, scene, 1 << 20) as writer:
        for k, packet in enumerate(packets):
            writer.packet(10**18 + k * 10**8, "127.0.0.1:5", packet)
        writer.event(10**18, tapes.ONSET | {"onset": 1e9})
        writer.event(10**18, tapes.TAP | {"onset": 1e9, "offset": 1e9 + 0.2, "decided": 1e9 + 0.3})
    # The same without chunks and their checksums, so that what is damaged is read.
    inside = [*(tapes.message(1, 10**18 + k * 10**8, packet) for k, packet in enumerate(packets))]
    bare = tapes.write(folder / "bare.mcap", tapes.CHANNELS, *inside, start=tapes.START)
    return [path.read_bytes(), bare.read_bytes(), tapes.events(folder / "e.mcap", tapes.ONSET, tapes.TAP).read_bytes()]


def _csv(folder: Path) -> list[bytes]:
    touched = range(30, 40)
    rows = [",".join(["%g" % (k / 15), *(str(500 if k in touched and n == 4 else k % 2) for n in range(9))])
            for k in range(60)]  # fmt: skip
    return ["\n".join(["time" + ",t" * 9, *rows]).encode(), "\r\n".join(rows).encode("utf-8-sig")]


SEEDS: dict[str, Callable[[Path], list[bytes]]] = {
    "npz": _npz, "mcap": _mcap, "csv": _csv,
}  # fmt: skip
WORDS = (b"", b"\0", b"\xff" * 8, b"\n", b",", b";", b"1e308", b"-1", b"nan", b"[" * 3000, b"9" * 400, b'"', b"null",
         struct.pack("<Q", 1 << 40), struct.pack("<I", 0xFFFFFFFF), b"\x93NUMPY", b"PK\x01\x02")  # fmt: skip


def mutated(data: bytes, rng: random.Random) -> bytes:
    """One to four edits: cut off, flip, repeat, remove, put a word in, grow."""
    for _ in range(rng.randint(1, 4)):
        a, b = sorted((rng.randint(0, len(data)), rng.randint(0, len(data))))
        b = min(b, a + rng.choice((1, 8, 100, 10_000)))
        how = rng.randrange(6)
        if how == 0:
            data = data[:a]
        elif how == 1:
            data = data[:a] + bytes(rng.randrange(256) for _ in range(min(b - a, 4))) + data[a + min(b - a, 4) :]
        elif how == 2:
            data = data[:a] + data[a:b] * rng.choice((2, 3, 50)) + data[b:]
        elif how == 3:
            data = data[:a] + data[b:]
        elif how == 4:
            data = data[:a] + rng.choice(WORDS) + data[a + rng.choice((0, 1, 8)) :]
        else:
            data += bytes(rng.choice((1, 22, 5000)))
    return data[: 1 << 20]


def repacked(data: bytes, rng: random.Random) -> bytes:
    """A member of an archive mutated, with checksums that hold: what zipfile would find is not found."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        held = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(sorted(held))
    held[name] = mutated(held[name], rng)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, content in held.items():
            archive.writestr(member, content)
    return buffer.getvalue()


def rechunked(data: bytes, rng: random.Random) -> bytes:
    """A tape's JSON mutated behind its lengths: only what is said is wrong."""
    at = data.rfind(b'{"', 0, rng.randint(2, len(data)))
    end = data.find(b"}", at) + 1
    if at < 0 or not end:
        return mutated(data, rng)
    inside = mutated(data[at:end], rng)
    return data[:at] + inside[: end - at].ljust(end - at) + data[end:]


def damaged(kind: str, seeds: list[bytes], number: int) -> bytes:
    """The `number`th damaged file of a kind, always the same."""
    rng = random.Random(zlib.crc32(f"{kind} {number}".encode()))
    seed = rng.choice(seeds)
    deeper = {"npz": repacked, "mcap": rechunked}.get(kind, mutated)
    return rng.choice((mutated, deeper))(seed, rng)


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[bytes]]:
    return {kind: make(tmp_path_factory.mktemp(kind)) for kind, make in SEEDS.items()}


@pytest.mark.parametrize("kind", SEEDS)
def test_the_files_that_are_damaged_are_good_ones(kind: str, seeds, tmp_path: Path) -> None:
    for data in seeds[kind]:
        (tmp_path / "good").write_bytes(data)
        assert refused(kind, tmp_path / "good") == ""


@pytest.mark.parametrize("kind", SEEDS)
@given(number=st.integers(0, 1 << 32))
@settings(deadline=None)
def test_any_damaged_file_is_data_or_one_sentence(kind: str, seeds, tmp_path_factory, number: int) -> None:
    path = tmp_path_factory.getbasetemp() / f"damaged.{kind}"
    path.write_bytes(damaged(kind, seeds[kind], number))
    with np.errstate(all="raise"):
        refused(kind, path)


@pytest.mark.parametrize("kind", SEEDS)
def test_damaged_files_take_little_memory(kind: str, seeds, tmp_path: Path) -> None:
    for number in range(60):
        (tmp_path / f"{number:03}").write_bytes(damaged(kind, seeds[kind], number))
    _, mib = in_bounds(kind, tmp_path, MIB)
    assert kind in KINDS and mib < 128
