"""The key tables as Markdown."""

import re
from pathlib import Path
from typing import Any

from gestured.lab.study.report.page import write_report
from tests.lab.study.made_study import small_study


def tables(study: dict[str, Any], out: Path) -> str:
    return write_report(study, out).with_name("tables.md").read_text("utf-8")


def test_each_table_is_rectangular_and_every_cell_of_the_study_stands_in_it(tmp_path: Path, undrawn: None) -> None:
    study = small_study()
    text = tables(study, tmp_path)
    for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        assert len({line.count(" | ") for line in block.splitlines()}) == 1
    for row in study["cells"]:
        if row["data"] in ("simulated", "real"):
            assert f"{row['right']:.2f} ({row['low']:.2f}-{row['high']:.2f})" in text


def test_what_was_not_computed_is_a_dash_or_no_row(tmp_path: Path, undrawn: None) -> None:
    study = small_study() | {"online": [], "online_shipped": [], "choices": [], "copies": []}
    for row in study["run_time"]:
        row["memory_bytes"] = None
    study["cells"] = [cell for cell in study["cells"] if cell["protocol"] != "real"]
    text = tables(study, tmp_path)
    assert "None" not in text
    assert text.count("## ") == 5
    assert re.search(r"\| LSTM \| tuned \| none \|.* \| - \| [^|]* \|\n", text)
