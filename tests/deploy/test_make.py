"""What make does in a clone whose environment is there already; pip and other programs are stand-ins."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("target", "done"),
    [
        ("demo", ["{clone}: gesturectl demo --seconds 60 --model cnn_lstm"]),  # this folder's package and no copy
        ("bridges", [": pip install -e .[mqtt,zenoh,serial]", ": gestured-bridge --help"]),
    ],
)
def test_a_target_asks_pip_for_what_is_missing_and_for_nothing_else(tmp_path: Path, target: str, done: list[str]):
    programs = tmp_path / ".venv" / "bin"
    programs.mkdir(parents=True)
    for name in ("pip", "python", "gesturectl", "gestured-bridge"):
        (programs / name).write_text(f'#!/bin/sh\n[ "$1" = -c ] || echo "$PYTHONPATH: {name} $*" >>done.txt\n')
        (programs / name).chmod(0o755)
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    (tmp_path / ".venv" / ".runtime").touch()
    made = subprocess.run(["make", target], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert made.returncode == 0, made.stderr
    assert (tmp_path / "done.txt").read_text().splitlines() == [line.format(clone=tmp_path) for line in done]


Install = Callable[[str, Path], "subprocess.CompletedProcess[str]"]


@pytest.fixture
def run(tmp_path: Path) -> Install:
    """Runs deploy/install.sh or deploy/uninstall.sh, with a pip that installs nothing."""
    pytest.importorskip("shtab")
    programs = tmp_path / "venv" / "bin"
    programs.mkdir(parents=True)
    (programs / "python").write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    (programs / "pip").write_text("#!/bin/sh\n")
    for program in programs.iterdir():
        program.chmod(0o755)

    def run(script: str, root: Path) -> "subprocess.CompletedProcess[str]":
        venv = [programs.parent] if script == "install" else []
        command = [ROOT / "deploy" / f"{script}.sh", *venv, root, "/usr"]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)

    return run


def test_what_an_older_version_had_installed_goes_with_an_upgrade_and_settings_stay(tmp_path: Path, run: Install):
    root = tmp_path / "root"
    assert (done := run("install", root)).returncode == 0, done.stderr
    old, mine = root / "usr/share/doc/gestured/old.md", root / "etc/gestured/gestured.toml"
    old.write_text("a page that is no more")
    mine.write_text("touch = true\n")
    with (root / "usr/lib/gestured/installed").open("a") as installed:
        installed.write("/usr/share/doc/gestured/old.md\n")
    assert (done := run("install", root)).returncode == 0, done.stderr
    assert not old.exists()
    assert (done := run("uninstall", root)).returncode == 0, done.stderr
    assert [path for path in root.rglob("*") if path.is_file()] == [root / "etc/default/gestured", mine]
    assert mine.read_text() == "touch = true\n"
