"""`gestured-lab stability`: its tables, as Markdown and as JSON."""

import argparse
import json
from collections.abc import Iterator

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


def test_tables_are_printed_as_they_are_done_or_as_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def tables(quick: bool) -> Iterator[Table]:
        assert quick
        yield TABLE

    monkeypatch.setattr(command, "all_tables", tables)
    assert command.run(argparse.Namespace(quick=True, json=False)) == 0
    assert str(TABLE) in capsys.readouterr().out
    assert command.run(argparse.Namespace(quick=True, json=True)) == 0
    said = json.loads(capsys.readouterr().out)
    assert "cores" in said["measured"]
    assert said["tables"][0]["rows"][0] == ["ours", 1.234e-16, 3]
