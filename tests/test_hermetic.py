"""The tests themselves: they pass whatever the environment says and whatever else runs on this machine."""

import os
import socket
import subprocess
import sys
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# Settings, refusals, default sockets, commands and sentences: what an environment has changed before.
FEW = (
    "tests/daemon/test_parts.py::test_flags_win_over_the_environment_that_over_the_file_that_over_defaults",
    "tests/daemon/test_parts.py::test_a_bug_in_the_path_of_one_sensor_ends_its_contact_and_nothing_else",
    "tests/daemon/test_start.py::test_the_default_socket_is_the_sessions",
    "tests/daemon/test_start.py::test_a_file_that_is_not_valid",
    "tests/daemon/test_start.py::test_flags_and_variables_that_are_not_valid",
    "tests/daemon/test_start.py::test_explain_says_what_is_loaded_and_what_is_left_out",
    "tests/daemon/test_start.py::test_a_model_that_cannot_be_used",
    "tests/control/test_address.py",
    "tests/control/test_listen.py::test_every_type_has_its_line",
    "tests/control/test_operate.py::test_without_a_daemon_each_says_so_in_one_line",
    "tests/lab/recordings/test_collect.py::test_a_silent_sensor_is_told_and_ctrl_c_leaves_the_terminal_as_it_was",
)


@pytest.fixture
def long_link(tmp_path: Path) -> Path:
    """A link to a folder, with a path too long for a Unix socket below it (108 bytes)."""
    there = tmp_path / ("long" * 30)
    there.mkdir()
    link = tmp_path / "link"
    link.symlink_to(there)
    return link


def test_a_hostile_environment_changes_no_test(tmp_path: Path, long_link: Path) -> None:
    no_folder = tmp_path / "file"
    no_folder.touch()
    hostile = {
        "GESTURED_X": "what is that?",
        "GESTURED_LISTEN": "nowhere",
        "GESTURED_SOCKET": "/nowhere/events.sock",
        "GESTURED_CONTROL": "/nowhere/events.ctl",
        "GESTURED_CONFIG": "/nowhere/gestured.toml",
        "RUNTIME_DIRECTORY": "/nowhere",
        "XDG_RUNTIME_DIR": str(no_folder),
        "XDG_CONFIG_HOME": str(no_folder),
        "HOME": "/nowhere",
        "TMPDIR": str(long_link),
        "LANG": "de_DE.UTF-8",
        "LC_ALL": "tr_TR",
        "COLUMNS": "20",
        "FORCE_COLOR": "1",
        "NO_COLOR": "1",
        "TERM": "xterm",
        "TZ": "Asia/Kathmandu",
        "NOTIFY_SOCKET": "/nowhere/notify",
        "WATCHDOG_USEC": "1",
        "LISTEN_FDS": "1",
        "OMP_NUM_THREADS": "none",
        "http_proxy": "http://127.0.0.1:9",
        "all_proxy": "http://127.0.0.1:9",
        "PYTHONSAFEPATH": "1",
    }
    command: list[object] = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    command += ["-c", ROOT / "pyproject.toml", *(ROOT / test for test in FEW)]
    with ExitStack() as stack:
        for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM):
            taken = stack.enter_context(socket.socket(socket.AF_INET, kind))
            with suppress(OSError):  # another program has it, which is as good
                taken.bind(("127.0.0.1", 9000))
        done = subprocess.run(
            ["sh", "-c", "trap '' INT; exec \"$@\"", "sh", *map(str, command)],
            cwd=long_link, env=os.environ | hostile, umask=0o077, capture_output=True, text=True, timeout=100,
        )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
