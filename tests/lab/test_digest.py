"""The digest of code by which the lab knows what it has computed before: what changes it, and what does not."""

import importlib.util
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import gestured
from gestured.lab import made_of
from gestured.lab.digest import code_digest


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the package that can be changed."""
    shutil.copytree(Path(gestured.__file__).parent, tmp_path / "gestured", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "gestured"


def digest_of(package: Path) -> Callable[[str, frozenset[str]], str]:
    """The function as that package has it, which reads that package's code."""
    spec = importlib.util.spec_from_file_location("digest_of_a_copy", package / "lab" / "digest.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found: Callable[[str, frozenset[str]], str] = module.code_digest
    return found


def digest(package: Path, module: str) -> str:
    return digest_of(package)(module, frozenset())


def test_comments_docstrings_and_line_breaks_are_no_code(copy: Path) -> None:
    before = digest(copy, "gestured.lab.dataset")
    assert before == code_digest("gestured.lab.dataset")
    for path in copy.rglob("*.py"):
        path.write_text("# Said about it.\n\n" + path.read_text().replace('"""', '"""Said about it. ', 1))
    assert digest(copy, "gestured.lab.dataset") == before


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
    before = digest(copy, module)
    with (copy / room).open("a") as file:
        file.write("\nOTHER_CODE = 1\n")
    assert digest(copy, module) != before


@pytest.mark.parametrize("room", ["control/cli.py", "core/osc.py", "core/sensor.py", "client/subscriber.py"])
def test_code_that_is_not_used_does_not_count(copy: Path, room: str) -> None:
    before = digest(copy, "gestured.lab.dataset")
    (copy / room).write_text("")
    assert digest(copy, "gestured.lab.dataset") == before


def test_a_table_names_the_code_that_decides_it_and_no_more(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def told() -> list[str]:
        monkeypatch.setattr(made_of, "code_digest", digest_of(copy))
        return [made_of.decides.__wrapped__(code) for code in (made_of.DECIDES, ("gestured.core.where",))]

    begun = told()
    for room, changed in (
        ("daemon/service.py", []), ("core/osc.py", []), ("lab/everyday/hours.py", []), ("core/spots.py", [1]),
        ("core/decision.py", [0]), ("model/context.py", [0]), ("core/contact.py", [0, 1]),
    ):  # fmt: skip
        before = (copy / room).read_text()
        (copy / room).write_text(f"{before}\nOTHER_CODE = 1\n")
        assert [n for n, (one, other) in enumerate(zip(begun, told(), strict=True)) if one != other] == changed, room
        (copy / room).write_text(before)
