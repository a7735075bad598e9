"""What `make demo` and `make bridges` do in a clone whose environment is there already; the programs are stand-ins."""

import shutil
import subprocess
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
