"""What `make demo` and `make bridges` do in a clone whose environment is there already; pip itself is a stand-in."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import gestured

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A folder with the Makefile, and an environment that runs this package and notes what is done with it."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    programs = tmp_path / ".venv" / "bin"
    programs.mkdir(parents=True)
    for name in ("pip", "gesturectl", "gestured-bridge"):
        (programs / name).write_text(f'#!/bin/sh\necho {name} "$@" >>"{tmp_path}/done.txt"\n')
    (programs / "python").write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    for program in programs.iterdir():
        program.chmod(0o755)
    (tmp_path / ".venv" / ".runtime").touch()
    return tmp_path


def done(clone: Path, target: str) -> list[str]:
    """The commands of the environment that a target has run."""
    made = subprocess.run(["make", target], cwd=clone, capture_output=True, text=True, timeout=60)
    assert made.returncode == 0, made.stderr
    return (clone / "done.txt").read_text().splitlines()


def test_the_demo_runs_this_folders_package_and_no_copy(clone: Path):
    """`pip install .` in the environment makes a copy of what is linked there: later edits would have no effect."""
    (clone / "gestured").mkdir()
    installed, demo = done(clone, "demo")
    assert installed == "pip install -e ." and demo.startswith("gesturectl demo")


def test_the_demo_asks_pip_for_nothing_where_the_package_is_this_folders(clone: Path):
    (clone / "gestured").symlink_to(Path(gestured.__file__).parent)
    (demo,) = done(clone, "demo")
    assert demo.startswith("gesturectl demo")


def test_bridges_are_installed_beside_the_package_which_stays_linked(clone: Path):
    installed, shown = done(clone, "bridges")
    assert installed == "pip install -e .[mqtt,zenoh,serial]" and shown == "gestured-bridge --help"
    assert done(clone, "bridges")[2:] == ["gestured-bridge --help"]
