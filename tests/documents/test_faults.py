"""The table of docs/sensors.md, what a sensor may do wrong: what it names is there, and nothing is left out."""

import importlib
import re

import pytest

from tests.documents.blocks import ROOT

PAGE = (ROOT / "docs" / "sensors.md").read_text().partition("## What a sensor may do wrong")[2]
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in PAGE.splitlines() if line.startswith("| ")]
FAULTS = ROWS[1:]
SCENARIOS = ROOT / "tests" / "scenarios"
TESTS = "".join((ROOT / "tests" / "core" / f"test_{name}.py").read_text() for name in ("conditioning", "wire"))
EXPECTED = {
    "clipped", "still", "stuck", "freezes", "noisy", "drifts", "restarted", "shifted", "bursts", "spikes",
    "after-effect", "under a hand", "object", "no number", "repeats",
    "rubbish", "loud", "jump",
}  # fmt: skip


def names(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


def test_each_fault_has_its_row() -> None:
    assert {fault for row in FAULTS for fault in re.findall(r"\*\*(.+?)\*\*", row[0])} == EXPECTED


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row[0][:40])
def test_what_deals_with_a_fault_and_what_shows_it_are_there(row: list[str]) -> None:
    _, code, _, shown = row
    assert names(code) and names(shown)
    for name in names(code):
        module, *path = name.split(".")
        found: object = importlib.import_module(f"gestured.core.{module}")
        assert path
        for part in path:
            found = getattr(found, part)
    for name in names(shown):
        if name.endswith(".txt"):
            assert (SCENARIOS / name).is_file()
        else:
            assert f"def {name}(" in TESTS
