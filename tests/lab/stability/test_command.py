"""`gestured-lab stability`: its tables, as Markdown and as JSON."""

import argparse
import json
from pathlib import Path

import pytest

from gestured.lab.stability import command
from gestured.lab.table import Table

TABLE = Table("Errors", ("way", "error", "how many"), [("ours", 1.234e-16, 3), ("theirs", 0.5, 12)], ("A note.",))


def test_a_table_is_markdown() -> None:
    title, empty, head, rule, *rows = str(TABLE).splitlines()
    assert (title, empty) == ("### Errors", "")
    assert {len(line) for line in (head, rule, *rows[:2])} == {len(head)}
    assert [cell.strip() for cell in rows[0].strip("|").split("|")] == ["ours", "1.2e-16", "3"]
    assert rows[-1] == "A note."


PAGE = "Before.\n<!-- one: begin -->\n<!-- one: end -->\nAfter.\n"


def test_tables_are_printed_as_they_are_done_or_as_json_and_written_into_a_page(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def table(quick: bool) -> Table:
        assert quick
        return TABLE

    monkeypatch.setattr(command, "TABLES", {"one": table})
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    args = argparse.Namespace(quick=True, json=False, document=page, words="gestured-lab stability --quick")
    assert command.run(args) == 0
    assert str(TABLE) in capsys.readouterr().out
    assert str(TABLE) in page.read_text() and "`gestured-lab stability --quick`" in page.read_text()
    assert command.run(argparse.Namespace(quick=True, json=True, document=None)) == 0
    assert json.loads(capsys.readouterr().out)[0]["rows"][0] == ["ours", 1.234e-16, 3]
