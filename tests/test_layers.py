"""The import rule of ARCHITECTURE.md: core <- model, record, simulator, client <- daemon | control | bridge | lab."""

import ast
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "gestured"

CORE_MAY = {
    "numpy",
    "dataclasses",
    "enum",
    "math",
    "struct",
    "json",
    "base64",
    "typing",
    "collections",
    "functools",
    "ipaddress",
    "itertools",
}
LAYERS = {"core": 0, "daemon": 2, "control": 2, "bridge": 2, "lab": 2}  # everything else is between them
LAB_ONLY = {"torch", "sklearn", "onnx", "joblib", "scipy"}
OUTSIDE = {"experiments", "tests", "benchmarks"}  # they use the package, never the other way round
ONLY_IN = {
    "onnxruntime": {"gestured/model/session.py"},
    "mcap": {"gestured/record/mcap.py", "gestured/record/tape_reader.py", "gestured/record/tape_writer.py"},
    "pythonosc": {"gestured/client/osc_out.py"},
    "prometheus_client": {"gestured/daemon/exposition.py", "gestured/bridge/counts.py"},
    "paho": {"gestured/bridge/broker.py"},
    "zenoh": {"gestured/bridge/zenoh_session.py", "gestured/bridge/zenoh_ros.py"},
    "serial": {"gestured/bridge/serial.py"},
}


@cache
def parsed(text: str) -> ast.Module:
    """A module's tree."""
    return ast.parse(text)


def imports(path: Path) -> Iterator[tuple[str, bool]]:
    """(full name of each imported module, whether only inside a function)."""
    package = path.relative_to(ROOT).with_suffix("").parts[:-1]

    def walk(node: ast.AST, inside: bool) -> Iterator[tuple[str, bool]]:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, inside
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(part for part in (base, node.module) if part)
            for alias in node.names:
                yield f"{module}.{alias.name}", inside
        inside = inside or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for child in ast.iter_child_nodes(node):
            yield from walk(child, inside)

    yield from walk(parsed(path.read_text()), False)


def faults(path: Path) -> list[str]:
    """What the imports of one file break."""
    where = path.relative_to(ROOT).as_posix()
    room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    found = []
    for name, inside in imports(path):
        top = name.split(".")[0]
        if top == "gestured":
            other = (name.split(".") + [""])[1]
            above = LAYERS.get(other, 1 if (PACKAGE / other).is_dir() or (PACKAGE / f"{other}.py").exists() else 0)
            beside = above == LAYERS.get(room, 1) == 2 and other != room
            if beside or above > LAYERS.get(room, 1):
                found.append(f"{where}: {room} must not import {name}")
        elif room == "core" and top not in CORE_MAY:
            found.append(f"{where}: core must not import {name}")
        if top in OUTSIDE:
            found.append(f"{where}: the package must not import {name}")
        if room != "lab" and top in LAB_ONLY:
            found.append(f"{where}: only the lab imports {name}")
        if top in ONLY_IN and where not in ONLY_IN[top]:
            found.append(f"{where}: {name} belongs into {', '.join(sorted(ONLY_IN[top]))}")
        if top == "onnxruntime" and not inside:
            found.append(f"{where}: {name} is imported where a model is opened, not before")
    return found


FILES = sorted(PACKAGE.rglob("*.py"))


def test_imports_go_downwards_only() -> None:
    assert [fault for path in FILES for fault in faults(path)] == []


def known() -> dict[str, set[str]]:
    """Module -> the modules of the package that it names: in an import, wherever it stands, or in a text."""
    names = {path: ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in FILES}
    modules = {name for name in names.values() if "." in name}
    found = {}
    for path, name in names.items():
        imported = {module for one, _ in imports(path) for module in (one, one.rpartition(".")[0])}
        texts = {node.value for node in ast.walk(parsed(path.read_text())) if isinstance(node, ast.Constant)}
        found[name] = {module for module in modules - {name} if module in imported or module in texts}
    return found


def test_no_two_modules_know_each_other() -> None:
    """A circle of imports: a third thing is missing between them."""
    left = known()
    while leaves := [name for name, others in left.items() if not others & left.keys()]:
        for name in leaves:
            del left[name]
    assert left == {}, "these import each other"


@pytest.mark.parametrize(
    ("where", "line"),
    [
        ("core/x.py", "import asyncio"),
        ("core/x.py", "def f():\n    import uvloop"),
        ("core/x.py", "from ..record.arrays import read"),
        ("model/session.py", "import onnxruntime"),
        ("daemon/x.py", "from ..control import cli"),
        ("control/x.py", "def f():\n    import gestured.daemon.settings"),
        ("simulator/x.py", "import torch"),
        ("control/x.py", "def f():\n    from pythonosc.udp_client import SimpleUDPClient"),
        ("daemon/x.py", "def f():\n    import onnxruntime"),
        ("lab/x.py", "def f():\n    import onnxruntime"),
        ("lab/x.py", "from experiments import foreign"),
    ],
)
def test_the_rule_notices(where: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    monkeypatch.setattr(sys.modules[__name__], "PACKAGE", tmp_path / "gestured")
    for room in ("model", "record"):
        (tmp_path / "gestured" / room).mkdir(parents=True)
    path = tmp_path / "gestured" / where
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(line)
    assert len(faults(path)) == 1
