"""Digests of code and of files: the keys under which the lab keeps results that take long to compute.

A digest of code depends only on what runs: a changed comment, docstring or line break leaves it as it is.
"""

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]  # found without an import, since all that is imported counts as used


@cache
def code_digest(module: str, aside: frozenset[str] = frozenset()) -> str:
    """SHA-256 of a module of gestured, such as `gestured.lab.fit`, and of all modules of gestured that it uses.

    A module counts as used if an import or a string anywhere in the code names it, since programs are started by name.
    Modules that are set `aside`, and modules that only these use, do not count.
    """
    found: dict[Path, str] = {}
    todo = list(_files(module))
    while todo:
        path = todo.pop()
        if path not in found:
            found[path], names = _code(path)
            todo += [other for name in names if name not in aside for other in _files(name)]
    total = hashlib.sha256()
    for path in sorted(found):
        total.update(f"{path.relative_to(PACKAGE)}\n{found[path]}\n".encode())
    return total.hexdigest()


@cache
def _code(path: Path) -> tuple[str, frozenset[str]]:
    """What a file's code does, and every name in it that may be a module's."""
    tree = _WithoutTexts().visit(ast.parse(path.read_bytes()))
    return ast.dump(tree), frozenset(_named(tree))


def file_digest(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class _WithoutTexts(ast.NodeTransformer):
    """Removes docstrings, and other constants that are statements of their own."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return None if isinstance(node.value, ast.Constant) else self.generic_visit(node)


def _named(tree: ast.Module) -> Iterator[str]:
    """Every name in a file's code that may be a module's; no import is relative (ruff's TID252)."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def _files(name: str) -> Iterator[Path]:
    """The files of a module or package; none if gestured has no module of this name."""
    first, *parts = name.split(".")
    if first != PACKAGE.name or not all(part.isidentifier() for part in parts):
        return
    place = PACKAGE.joinpath(*parts)
    for path in (place.with_suffix(".py"), place / "__init__.py", place / "__main__.py"):
        if path.is_file():
            yield path
