"""The digest of code by which the lab knows what it has computed before: what changes it, and what does not."""

import importlib.util
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import gestured
from gestured.lab import made_of
from gestured.lab.digest import code_digest

READ: dict[tuple[Path, str], tuple[str, frozenset[str]]] = {}  # what a file with this text does, and names


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package that can be changed, and is left as it was."""
    package = tmp_path_factory.mktemp("copy") / "gestured"
    shutil.copytree(Path(gestured.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    return package


@contextmanager
def changed(*paths: Path, by: Callable[[str], str]) -> Iterator[None]:
    """Files that hold something else for a while."""
    before = {path: path.read_text() for path in paths}
    try:
        for path, text in before.items():
            path.write_text(by(text))
        yield
    finally:
        for path, text in before.items():
            path.write_text(text)


def digest_of(package: Path) -> Callable[[str, frozenset[str]], str]:
    """The function as that package has it, which reads that package's code; a file that is as it was only once."""
    spec = importlib.util.spec_from_file_location("digest_of_a_copy", package / "lab" / "digest.py")
    assert spec is not None and spec.loader is not None
    module: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    read = module._code.__wrapped__
    module._code = lambda path: READ.get((path, text := path.read_text())) or READ.setdefault((path, text), read(path))
    found: Callable[[str, frozenset[str]], str] = module.code_digest
    return found


def digest(package: Path, module: str) -> str:
    return digest_of(package)(module, frozenset())


begun = cache(digest)  # of the copy as it was made


def test_comments_docstrings_and_line_breaks_are_no_code(copy: Path) -> None:
    assert begun(copy, "gestured.lab.dataset") == code_digest("gestured.lab.dataset")
    with changed(
        *copy.rglob("*.py"), by=lambda text: "# Said about it.\n\n" + text.replace('"""', '"""Said about it. ', 1)
    ):
        assert digest(copy, "gestured.lab.dataset") == begun(copy, "gestured.lab.dataset")


@pytest.mark.parametrize(
    ("module", "room"),
    [
        ("gestured.lab.dataset", "lab/dataset.py"),  # its own code
        ("gestured.lab.dataset", "core/segmenter.py"),  # what it imports imports it
        ("gestured.lab.dataset", "simulator/people.py"),  # through a package
        ("gestured.lab.study.sessions", "daemon/service.py"),  # a program that it starts
        ("gestured.lab.study.report", "lab/study/picture.py"),  # by its name in what the package holds
    ],
)
def test_every_change_of_code_that_is_used_changes_it(copy: Path, module: str, room: str) -> None:
    before = begun(copy, module)
    with changed(copy / room, by=lambda text: f"{text}\nOTHER_CODE = 1\n"):
        assert digest(copy, module) != before


def test_code_that_is_not_used_does_not_count(copy: Path) -> None:
    before = begun(copy, "gestured.lab.dataset")
    rooms = ("control/cli.py", "core/osc.py", "core/sensor.py", "client/subscriber.py")
    with changed(*(copy / room for room in rooms), by=lambda text: ""):
        assert digest(copy, "gestured.lab.dataset") == before


def test_a_table_names_the_code_that_decides_it_and_no_more(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def told() -> list[str]:
        monkeypatch.setattr(made_of, "code_digest", digest_of(copy))
        return [made_of.decides.__wrapped__(code) for code in (made_of.DECIDES, ("gestured.core.where",))]

    before = told()
    for room, other in (
        ("daemon/service.py", []), ("core/osc.py", []), ("lab/everyday/hours.py", []), ("core/spots.py", [1]),
        ("core/decision.py", [0]), ("model/context.py", [0]), ("core/contact.py", [0, 1]),
    ):  # fmt: skip
        with changed(copy / room, by=lambda text: f"{text}\nOTHER_CODE = 1\n"):
            assert [n for n, (one, now) in enumerate(zip(before, told(), strict=True)) if one != now] == other, room
