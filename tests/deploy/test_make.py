"""What make does in a clone whose environment is there already; pip and other programs are stand-ins."""

import os
import re
import shutil
import subprocess
import sys
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


def test_what_an_older_version_had_installed_goes_with_an_upgrade_and_settings_stay(tmp_path: Path):
    """With a pip that installs nothing, below another prefix, from a clone that its owner alone may read.

    Somebody ends the first attempt, with wheels as for a Debian package, while pip runs, as with Ctrl-C.
    """
    pytest.importorskip("shtab")
    root, clone, programs = tmp_path / "root", tmp_path / "my clone", tmp_path / "venv" / "bin"
    programs.mkdir(parents=True)
    ended = '[ -z "$WHEELS" ] || { printf "%s\\n" "$@" >asked.txt; kill -TERM $PPID; }'
    for name, text in (("python", f'exec {sys.executable} "$@"'), ("pip", ended)):
        (programs / name).write_text(f"#!/bin/sh\n{text}\n")
        (programs / name).chmod(0o755)
    clone.mkdir()
    for path in ROOT.iterdir():
        if path.name in ("deploy", "systemd"):
            shutil.copytree(path, clone / path.name)
        else:
            (clone / path.name).symlink_to(path)
    for name in ("deploy/gestured.toml", "systemd/gestured.default"):
        (clone / name).chmod(0o600)

    def run(script: str, *arguments: Path, status: int = 0, wheels: str = "") -> None:
        command = [f"deploy/{script}.sh", *arguments, root, "/usr/local"]
        environment = os.environ | {"WHEELS": wheels, "PLATFORM": "--abi none"}
        done = subprocess.run(command, cwd=clone, env=environment, capture_output=True, text=True, timeout=120)
        assert done.returncode == status, done.stderr

    share, lib, etc = (root / name for name in ("usr/local/share/doc/gestured", "usr/local/lib/gestured", "etc"))
    old, mine, fresh = share / "old.md", etc / "default/gestured", etc / "gestured/gestured.toml"
    before = {
        old: "a page that is no more",
        mine: "GESTURED_TOUCH=true\n",
        lib / "installed": "/usr/local/share/doc/gestured/old.md\n",
        lib / "old.py": "a module that is no more",
    }
    for path, text in before.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    wheels = [clone / "a-1.whl", clone / "b-1.whl"]
    for wheel in wheels:
        wheel.touch()
    run("install", programs.parent, status=130, wheels=str(clone))
    assert (clone / "asked.txt").read_text().splitlines()[-4:] == ["--abi", "none", *map(str, wheels)]
    assert {path for path in root.rglob("*") if path.is_file()} == set(before) and not lib.with_suffix(".new").exists()
    run("install", programs.parent)
    assert not old.exists() and not (lib / "old.py").exists()
    assert fresh.stat().st_mode & 0o777 == 0o644  # the daemon's account reads it
    operating = (share / "operating.md").read_text()
    assert re.findall(r"/usr/(?:bin/gesture|lib/gestured|share/doc)\S*", operating) == []
    assert "/usr/local/lib/gestured/gestured_models/lstm.onnx" in operating
    run("uninstall")
    assert sorted(path for path in root.rglob("*") if path.is_file()) == [mine, fresh]
    assert mine.read_text() == before[mine]
