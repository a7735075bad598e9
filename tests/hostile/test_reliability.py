"""The table of faults is true: its tests and metrics exist, and every fault that is measured has its figures."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from gestured.bridge.counts import HELP
from tests.hostile.faults import FAULTS

FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
TESTS = Path(__file__).parents[1]
TEXT = (TESTS.parent / "docs" / "reliability.md").read_text()
METRICS = {*re.findall(r"^# TYPE (\S+)", (TESTS / "daemon" / "metrics.txt").read_text(), re.MULTILINE)}
METRICS |= {f"gestured_bridge_{name}{'' if name == 'connected' else '_total'}" for name in HELP}
ROWS = [line for line in TEXT.split("\n## ")[0].splitlines() if line.startswith("| ") and "| fault |" not in line]


@cache
def functions(file: str) -> dict[str, bool]:
    """The functions of a file by name, and whether each is a slow test."""
    found = [one for one in ast.parse((TESTS / file).read_text()).body if isinstance(one, FUNCTIONS)]
    return {one.name: any("mark.hostile" in ast.unparse(mark) for mark in one.decorator_list) for one in found}


@pytest.mark.parametrize("row", ROWS, ids=[row[2:40] for row in ROWS])
def test_each_fault_has_a_promise_a_test_and_a_metric(row: str) -> None:
    _, promise, tests, metrics = row.strip("| ").split(" | ")
    assert promise
    names = re.findall(r"`([a-z_/]+\.py)::(\w+)`( \(slow\))?", tests)
    assert names
    for file, name, slow in names:
        assert functions(file)[name] == bool(slow), name
    for metric in re.findall(r"`(gestured_\w+)`", metrics):
        assert metric in METRICS


def test_each_fault_that_is_measured_has_its_figures() -> None:
    table = TEXT.split("<!-- damage: begin -->")[1].split("<!-- damage: end -->")[0]
    assert set(FAULTS) <= set(re.findall(r"^\| ([^|]+?) +\|", table, re.MULTILINE))
