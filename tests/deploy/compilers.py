"""Compilers of C and C++, for this machine and for controllers, and what they are told to complain about."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HEADERS = ROOT / "deploy" / "c"
HERE = Path(__file__).parent / "c"
C, CPP = "-std=c99", "-std=c++11"
POSIX = "-D_POSIX_C_SOURCE=200809L"
WARNINGS = (
    "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wundef", "-Wcast-align",
    "-Wcast-qual", "-Wwrite-strings", "-Wdouble-promotion", "-Wfloat-equal", "-Wformat=2", "-Wunused", "-Werror",
)  # fmt: skip
C_WARNINGS = ("-Wstrict-prototypes", "-Wmissing-prototypes", "-Wc++-compat")


def compiled(compiler: str, standard: str, out: Path, *arguments: object) -> Path:
    """What a compiler makes, without one warning; skips where it is not installed."""
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    warnings = WARNINGS + (C_WARNINGS if standard == C else ())
    command = [compiler, standard, *warnings, "-O2", f"-I{HEADERS}", *map(str, arguments), "-o", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    return out
