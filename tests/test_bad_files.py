"""Files that are small and want to be large, and files that are damaged: one sentence, in bounded memory."""

import os
import struct
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.opening import in_bounds, refused
from tests.small_recording import FIELDS, archive_of, example, header, save

MIB = 128  # for a file; the bombs below want twice as much or more
NPY = b"\x93NUMPY"


def bomb(path: Path, **big: tuple[str, tuple[int, ...]]) -> Path:
    """The example with fields that are nothing but zeros: (dtype, shape) of each."""
    save(path, example())
    with zipfile.ZipFile(path) as archive:
        members = {name.removesuffix(".npy"): archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name in FIELDS:
            with archive.open(f"{name}.npy", "w") as member:
                if name not in big:
                    member.write(members.get(name, header("|u1", (0,))))
                    continue
                member.write(header(*big[name]))
                left = int(np.prod(big[name][1])) * np.dtype(big[name][0]).itemsize
                while left > 0:
                    left -= member.write(bytes(min(left, 1 << 20)))
    return path


BIG = 1 << 28  # bytes


@pytest.mark.parametrize(
    ("big", "said"),
    [
        ({"frames": ("|u1", (BIG // 4096, 64, 64))}, "times"),
        ({"labels": ("<U67108864", (1,))}, "labels"),
        ({"subjects": ("<i8", (BIG // 8,))}, "subjects"),
        ({"touches": ("<f4", (BIG // 24, 3, 2))}, "touches"),
        ({"event_recording": ("<i8", (BIG // 8,))}, "event_"),
        ({"kinds": ("|O", (BIG // 8,))}, "kinds"),
        ({"times": ("|u1", (BIG,))}, "times"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else None,
)
def test_an_npz_is_looked_at_before_it_is_unpacked(
    tmp_path: Path, big: dict[str, tuple[str, tuple[int, ...]]], said: str
) -> None:
    path = bomb(tmp_path / "r.npz", **big)
    assert path.stat().st_size < 4 << 20
    reason, mib = in_bounds("npz", path, MIB)
    assert f"{path}: {said}" in reason and mib < 64


def test_frames_are_unpacked_last(tmp_path: Path) -> None:
    """Where nothing but a label is wrong, too."""
    n = BIG // 4096
    ramp = header("<f8", (n,)) + np.arange(n, dtype="<f8").tobytes()
    path = bomb(tmp_path / "r.npz", frames=("|u1", (n, 64, 64)))
    made = {
        "offsets": header("<i8", (2,)) + np.array([0, n]).tobytes(),
        "labels": header("<U4", (1,)) + np.array(["OH !"]).tobytes(),
        "subjects": header("<i8", (1,)) + bytes(8),
        "times": ramp,
    }
    with zipfile.ZipFile(path) as archive:
        frames = archive.open("frames.npy")
        with zipfile.ZipFile(tmp_path / "s.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as other:
            for name, data in made.items():
                other.writestr(f"{name}.npy", data)
            with other.open("frames.npy", "w") as member:
                while piece := frames.read(1 << 20):
                    member.write(piece)
    reason, mib = in_bounds("npz", tmp_path / "s.npz", MIB)
    assert "s.npz: labels of recording 0" in reason and mib < 64


def test_what_is_good_takes_its_own_size_once(tmp_path: Path) -> None:
    n = 1 << 12
    frames = np.zeros((n, 64, 64), ">i4")  # 64 MiB, in the other byte order
    large = {"frames": frames, "times": np.arange(n) / 1000, "offsets": np.array([0, n]), "labels": np.array(["none"])}
    np.savez_compressed(tmp_path / "r.npz", subjects=np.array([1]), **large)
    assert in_bounds("npz_alone", tmp_path / "r.npz", 112)[0] == ""


def test_a_header_that_is_larger_than_any_is_not_read(tmp_path: Path) -> None:
    path = archive_of(tmp_path / "r.npz")
    with zipfile.ZipFile(path) as archive:
        held = {name: archive.read(name) for name in archive.namelist() if name != "times.npy"}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, data in held.items():
            archive.writestr(name, data)
        with archive.open("times.npy", "w") as member:
            member.write(NPY + b"\x02\x00" + struct.pack("<I", BIG))
            for _ in range(256):
                member.write(b" " * (1 << 20))
    reason, mib = in_bounds("npz", path, MIB)
    assert ": times: " in reason and mib < 64


def test_an_archive_of_thousands_of_names_is_not_listed(tmp_path: Path) -> None:
    path = archive_of(tmp_path / "r.npz", **{f"{k}.npy": b"" for k in range(6_000)})
    assert "members" in refused("npz", path)


@pytest.mark.parametrize("name", ["../frames.npy", "a/times.npy", "a\\times.npy", "/labels.npy"])
def test_names_that_lead_elsewhere_are_refused(tmp_path: Path, name: str) -> None:
    assert "expected names without folders" in refused("npz", archive_of(tmp_path / "r.npz", **{name: b""}))


@pytest.mark.parametrize(("name", "said"), [("mine.npy", "mine.npy"), ("times.npy", "times")])
def test_a_name_that_is_there_twice_is_refused_whatever_it_names(tmp_path: Path, name: str, said: str) -> None:
    path = archive_of(tmp_path / "r.npz", **{"mine.npy": b"x"})
    with warnings.catch_warnings(), zipfile.ZipFile(path, "a") as archive:
        warnings.simplefilter("ignore", UserWarning)
        archive.writestr(name, archive.read(name))
    assert f": {said}: is there twice" in refused("npz", path)


def test_the_size_that_the_archive_says_must_be_the_headers(tmp_path: Path) -> None:
    frames = header("|u1", (10, 2, 3)) + bytes(60)
    for data in (frames + b"\0", frames[:-1]):
        reason = refused("npz", archive_of(tmp_path / "r.npz", **{"frames.npy": data}))
        assert ": frames: expected 60 bytes for the shape (10, 2, 3)" in reason


def test_nothing_is_written_that_could_not_be_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from gestured.core.errors import RecordingError
    from gestured.record import arrays as recording

    monkeypatch.setattr(recording, "MAX_RECORDING_BYTES", 500)
    with pytest.raises(RecordingError, match="not written: unpacks to"):
        recording.write(tmp_path / "r.npz", example())
    assert os.listdir(tmp_path) == []
