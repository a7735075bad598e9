"""The file of the user's own gestures: what of it is read, and who writes it."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gestured.core.own import EXAMPLES, MOST, MOST_VALUES, Example
from gestured.daemon.keeper import Keeper
from gestured.model import own_file
from gestured.model.own_file import OwnFileError

EXAMPLE = Example(np.zeros((4, 9, 9), np.float16), 15.0, 0, 3, 0.1)
KILLED = """
import os, signal, sys
from pathlib import Path
from gestured.daemon.keeper import Keeper
os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
path = Path(sys.argv[1])
Keeper(path).change(lambda found: {}, "")
"""


def test_the_largest_file_that_can_be_enrolled_is_read_again(tmp_path: Path) -> None:
    longest = Example(np.zeros((64, 16, 16), np.float16), 15.0, 0, 63, 0.1)
    assert longest.frames.size == MOST_VALUES
    path = tmp_path / "own.json"
    own_file.write(path, {f"{k:a<32}": (longest,) * EXAMPLES for k in map(chr, range(97, 97 + MOST))}, "0" * 64)
    found = own_file.load(path)
    assert (found.fault, len(found.gestures)) == (None, MOST)


def test_millions_of_empty_lists_are_not_handed_to_the_reader_of_json(tmp_path: Path) -> None:
    path = tmp_path / "own.json"
    path.write_text('{"format": 1, "gestures": [' + "[]," * 2_700_000 + "[]]}")
    fault = own_file.load(path).fault
    assert fault is not None
    assert "expected at most 4096 brackets and commas" in fault


def test_what_a_killed_writer_has_left_is_gone_with_the_next_start_and_the_next_write(tmp_path: Path) -> None:
    path = tmp_path / "own.json"
    own_file.write(path, {"slash": (EXAMPLE,)}, "")
    kept = {"own.json", ".own.json.lock", ".own.json.swp"}
    (tmp_path / ".own.json.swp").touch()  # somebody else's
    killed = subprocess.run([sys.executable, "-c", KILLED, path], check=False)
    assert killed.returncode == -signal.SIGKILL
    left = set(os.listdir(tmp_path)) - kept
    assert len(left) == 1
    keeper = Keeper(path)
    keeper.hold()
    assert set(os.listdir(tmp_path)) == kept
    (tmp_path / left.pop()).touch()
    keeper.change(lambda found: {}, "")
    assert set(os.listdir(tmp_path)) == kept


def test_what_somebody_else_has_changed_meanwhile_is_read_before_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "own.json"
    keeper = Keeper(path)
    keeper.change(lambda found: {**found, "slash": (EXAMPLE,)}, "")
    keeper.change(lambda found: found, "")
    assert keeper.found.gestures["slash"] == (EXAMPLE,)  # it is not read anew
    own_file.write(path, {"slash": (EXAMPLE,), "wave": (EXAMPLE,)}, "")
    keeper.change(lambda found: {**found, "cut": (EXAMPLE,)}, "")
    assert keeper.found.gestures.keys() == {"slash", "wave", "cut"} == own_file.load(path).gestures.keys()
    path.write_text("no JSON")
    with pytest.raises(OwnFileError, match="is no file of own gestures"):
        keeper.change(lambda found: {}, "")
    assert path.read_text() == "no JSON"


def test_a_link_to_the_file_is_read_but_not_replaced_since_the_file_itself_would_stay_as_it_was(tmp_path: Path) -> None:
    path, link = tmp_path / "own.json", tmp_path / "link.json"
    own_file.write(path, {"slash": (EXAMPLE,)}, "")
    keeper = Keeper(link)
    keeper.hold()
    link.symlink_to(path)
    keeper.read()
    assert keeper.found.gestures.keys() == {"slash"}
    with pytest.raises(OwnFileError, match=f"link.json: is a link, expected the file itself, {path}; set"):
        keeper.change(lambda found: {}, "")
    assert link.is_symlink() and own_file.load(path).gestures.keys() == {"slash"}


@pytest.mark.parametrize(
    ("environ", "expected"),
    [
        ({"STATE_DIRECTORY": "/s:/t", "XDG_STATE_HOME": "/x", "HOME": "/h"}, "/s/own-gestures.json"),
        ({"XDG_STATE_HOME": "/x", "HOME": "/h"}, "/x/gestured/own-gestures.json"),
        ({"XDG_STATE_HOME": "x", "HOME": "/h"}, "/h/.local/state/gestured/own-gestures.json"),
        ({"XDG_STATE_HOME": "", "HOME": "h"}, None),
        ({}, None),
    ],
)
def test_where_it_is_unless_somebody_says_it(environ: dict[str, str], expected: str | None) -> None:
    assert own_file.where(None, environ) == (expected and Path(expected))
    assert own_file.where(Path("mine.json"), environ) == Path("mine.json")


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("/proc/own-gestures.json", "/proc/own-gestures.json: cannot be written: "),
        (f"/{'a' * 256}/own.json", "/own.json: cannot be read: File name too long"),
    ],
)
def test_where_it_cannot_be_written_or_read_that_is_said(path: str, words: str) -> None:
    keeper = Keeper(Path(path))
    keeper.read()
    assert words in str(keeper.fault)
    with pytest.raises(OwnFileError, match="cannot be written"):
        keeper.hold()
    with pytest.raises(OwnFileError, match="cannot be written: [^;]+$"):  # who hears it knows what has not changed
        own_file.write(Path(path), {}, "")


def test_a_folder_into_which_we_may_not_look_is_a_fault_of_the_file(tmp_path: Path, nobody) -> None:
    """As where a service's account was left the HOME of root."""
    tmp_path.chmod(0o700)
    keeper = Keeper(tmp_path / "state" / "own.json")
    with nobody():
        keeper.read()
    assert keeper.fault == f"{keeper.path}: cannot be read: Permission denied"


def test_a_folder_is_made_where_something_is_enrolled_and_not_before(tmp_path: Path) -> None:
    path = tmp_path / "state" / "gestured" / "own.json"
    keeper = Keeper(path)
    keeper.read()
    assert not path.parent.parent.exists() and keeper.fault is None
    keeper.change(lambda found: {"slash": (EXAMPLE,)}, "")
    assert path.stat().st_mode & 0o777 == 0o600 and path.parent.stat().st_mode & 0o777 == 0o700
    shutil.rmtree(path.parent)  # while the daemon runs
    keeper.change(lambda found: {**found, "cut": (EXAMPLE,)}, "")
    assert own_file.load(path).gestures.keys() == {"cut"}
    with pytest.raises(OwnFileError, match="another gestured"):
        Keeper(path).hold()


def test_who_has_let_go_of_a_file_must_lock_it_again(tmp_path: Path) -> None:
    one, other = Keeper(tmp_path / "own.json"), Keeper(tmp_path / "own.json")
    one.hold()
    one.close()
    other.hold()
    with pytest.raises(OwnFileError, match=rf"gestured \(pid {os.getpid()}\) writes it"):
        one.hold()
