"""Archives that are small and want to be large, and that lie about what they hold: one sentence, in bounded memory."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from gestured.core.errors import RecordingError
from gestured.record import arrays as recording
from tests.opening import in_bounds
from tests.small_recording import FIELDS, archive_of, example, header, refusal, save

MIB = 64  # for a file; the bombs below want twice as much
BIG = 1 << 27  # bytes


def bomb(path: Path, head: bytes, field: str) -> Path:
    """The example with a field that has this header, and BIG zeros behind it."""
    save(path, example())
    with zipfile.ZipFile(path) as archive:
        held = {name: archive.read(name) for name in archive.namelist() if name != f"{field}.npy"}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, data in held.items():
            archive.writestr(name, data)
        with archive.open(f"{field}.npy", "w") as member:
            member.write(head)
            for _ in range(BIG >> 20):
                member.write(bytes(1 << 20))
    return path


@pytest.mark.parametrize(
    ("field", "head"),
    [
        ("frames", header("|u1", (BIG // 4096, 64, 64))),
        ("labels", header(f"<U{BIG // 4}", (1,))),
        ("kinds", header("|O", (BIG // 8,))),
        ("times", b"\x93NUMPY\x02\x00" + BIG.to_bytes(4, "little")),  # a header that is larger than any
        ("times", b""),
    ],
    ids=["values", "text", "objects", "header", "nothing"],
)
def test_what_wants_more_memory_than_there_is_is_one_sentence(tmp_path: Path, field: str, head: bytes) -> None:
    path = bomb(tmp_path / "r.npz", head, field)
    assert path.stat().st_size < 4 << 20
    reason, _ = in_bounds("npz", path, MIB)
    assert f"{path}: {field}: " in reason


def test_what_is_good_takes_its_own_size_once(tmp_path: Path) -> None:
    n = 1 << 11
    frames = np.zeros((n, 64, 64), ">i4")  # 32 MiB, in the other byte order
    large = {"frames": frames, "times": np.arange(n) / 1000, "offsets": np.array([0, n]), "labels": np.array(["none"])}
    np.savez_compressed(tmp_path / "r.npz", subjects=np.array([1]), **large)
    assert in_bounds("npz_alone", tmp_path / "r.npz", 56)[0] == ""


def test_what_a_file_unpacks_to_is_bounded_whether_it_is_read_or_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = example()
    np.savez_compressed(tmp_path / "r.npz", **{k: getattr(made, k) for k in FIELDS if getattr(made, k) is not None})
    monkeypatch.setattr(recording, "MAX_RECORDING_BYTES", 500)
    assert "expected at most 500" in refusal(tmp_path / "r.npz")
    with pytest.raises(RecordingError, match="not written: unpacks to"):
        recording.write(tmp_path / "other.npz", made)
    assert [path.name for path in tmp_path.iterdir()] == ["r.npz"]


@pytest.mark.parametrize("shape", [(1 << 40, 2, 3), (10, 2, 4), (-10, -2, 3), (1 << 62, 1 << 62, 0)])
def test_header_that_lies_about_the_shape(tmp_path: Path, shape: tuple[int, ...]) -> None:
    data = header("|u1", shape) + bytes(60)
    assert ": frames: " in refusal(archive_of(tmp_path / "r.npz", **{"frames.npy": data}))
