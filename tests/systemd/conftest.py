"""What the tests of `make system-test` share: gestured installed, and the container that it is booted in."""

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.systemd.container import Container

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `make install` makes of an empty folder."""
    root = tmp_path_factory.mktemp("install") / "root"
    begin = time.monotonic()
    done = subprocess.run(["make", "install", f"DESTDIR={root}"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    report("make install", time.monotonic() - begin)
    return root


@pytest.fixture(scope="session")
def box(installed: Path) -> Iterator[Container]:
    """The booted container."""
    begin = time.monotonic()
    with Container(installed) as container:
        report("boot", time.monotonic() - begin)
        yield container


def report(what: str, seconds: float) -> None:
    """Print a measured time."""
    print(f"{what:44} {seconds:7.2f} s", file=sys.stderr)
