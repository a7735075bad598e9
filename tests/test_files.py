"""Files that are written at once or not at all, and files that are opened without trusting what they are."""

import ast
import os
import stat
from pathlib import Path

import pytest

from gestured.core.errors import RecordingError
from gestured.record import arrays as recording
from gestured.record import tape_writer
from gestured.record.files import PUBLIC, atomic_write, open_regular
from tests.opening import no_file
from tests.small_recording import session

PACKAGE = Path(__file__).parent.parent / "gestured"


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@pytest.fixture(autouse=True)
def _usual_umask():
    before = os.umask(0o022)
    yield
    os.umask(before)


def test_a_file_is_replaced_by_the_whole_new_one(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with atomic_write(path) as file:
        file.write(b"new")
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new" and os.listdir(tmp_path) == ["a.bin"]


def test_where_writing_fails_nothing_has_changed(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt), atomic_write(path) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert path.read_bytes() == b"old" and os.listdir(tmp_path) == ["a.bin"]


def test_a_file_is_its_owners_alone_unless_it_is_meant_for_all(tmp_path: Path) -> None:
    for name, more, expected in (("own", {}, 0o600), ("all", {"mode": PUBLIC}, 0o644)):
        (tmp_path / name).touch(0o666)
        with atomic_write(tmp_path / name, **more) as file:
            assert {mode(path) for path in tmp_path.glob(f".{name}.*")} == {expected}  # before a byte is in it
            file.write(b"x")
        assert mode(tmp_path / name) == expected


def test_a_planted_link_is_replaced_and_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"precious")
    (tmp_path / "a.bin").symlink_to(victim)
    with atomic_write(tmp_path / "a.bin") as file:
        file.write(b"new")
    assert victim.read_bytes() == b"precious"
    assert not (tmp_path / "a.bin").is_symlink() and (tmp_path / "a.bin").read_bytes() == b"new"


@pytest.mark.parametrize("kind", ["pipe", "link"])
def test_a_device_or_a_pipe_is_left_where_it_is(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "out.npz"
    os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/null")
    with pytest.raises(RecordingError, match="cannot be written: is not a regular file"):
        recording.write(path, session())
    assert path.is_symlink() if kind == "link" else path.is_fifo()
    assert os.listdir(tmp_path) == [path.name]


def test_the_name_of_what_is_being_written_cannot_be_foreseen(tmp_path: Path) -> None:
    names = set()
    for _ in range(8):
        with atomic_write(tmp_path / "a.bin"):
            names |= {path.name for path in tmp_path.glob(".a.bin.*")}
    assert len(names) == 8 and not any(str(os.getpid()) == name.rpartition(".")[2] for name in names)


def test_recordings_and_tapes_are_their_owners_alone(tmp_path: Path) -> None:
    recording.write(tmp_path / "07.npz", session())
    with tape_writer.Writer(tmp_path / "a.mcap", {}, 1 << 20):
        assert mode(tmp_path / "a.mcap") == 0o600
    assert mode(tmp_path / "07.npz") == 0o600


def test_a_tape_is_not_written_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RecordingError, match=r"a\.mcap: cannot be made"):
        tape_writer.Writer(tmp_path / "a.mcap", {}, 1 << 20)
    assert not (tmp_path / "elsewhere").exists()


def test_there_is_one_place_that_puts_a_file_into_anothers_stead() -> None:
    """`os.replace`, `os.rename`, `Path.rename`, and `Path.replace` (one argument; that of a text takes two)."""
    found = set()
    texts = {path: path.read_text() for path in PACKAGE.rglob("*.py")}
    for path in (path for path, text in texts.items() if ".replace(" in text or ".rename(" in text):
        for node in ast.walk(ast.parse(texts[path])):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                name, where = node.func.attr, node.func.value
                of_os = isinstance(where, ast.Name) and where.id == "os"
                if (of_os and name in ("replace", "rename")) or name == "rename":
                    found.add(path.relative_to(PACKAGE).as_posix())
                if name == "replace" and len(node.args) == 1 and not node.keywords:
                    found.add(path.relative_to(PACKAGE).as_posix())
    assert found == {"record/files.py"}


@pytest.mark.parametrize("kind", ["directory", "fifo", "zero"])
def test_what_is_no_regular_file_is_not_opened(tmp_path: Path, kind: str) -> None:
    with pytest.raises(OSError, match=r"not a regular file|[Ii]s a directory"):
        open_regular(no_file(kind, tmp_path / "a"))
