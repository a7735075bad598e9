"""What the lab's tests share. Without the packages of the extra [lab], most of them are left out."""

import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

from gestured.lab.cli import LAB_PACKAGES, main

Run = Callable[..., tuple[int, str, str]]

MISSING = [package for package in LAB_PACKAGES if find_spec(package) is None]
NEED_NO_LAB = {"recordings", "test_cli.py", "test_dataset.py", "test_digest.py"}


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Whether a test file or a folder of them cannot be imported here."""
    inside = collection_path.relative_to(Path(__file__).parent).parts
    return True if MISSING and inside and inside[0] not in NEED_NO_LAB else None


@pytest.fixture
def lab() -> None:
    """For a test that needs the extra [lab] among others that do not."""
    if MISSING:
        pytest.skip(f"needs of the extra [lab]: {', '.join(MISSING)}")


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs gestured-lab in this process: exit status, standard output, standard error."""

    def finish(*arguments: object) -> tuple[int, str, str]:
        try:
            status = main([*map(str, arguments)])
        except SystemExit as ended:  # argparse
            status = ended.code if isinstance(ended.code, int) else 1
        return status, *capsys.readouterr()

    return finish


@pytest.fixture(autouse=True)
def one_thread() -> None:
    """Nets this small are many times as slow on several threads, where something else computes; --jobs sets more."""
    if torch := sys.modules.get("torch"):  # only where a test has it: to import it takes seconds
        torch.set_num_threads(1)
