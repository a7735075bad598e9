"""The key tables as Markdown."""

import re

from gestured.lab.study.markdown import tables
from tests.lab.study.made_study import made_study


def test_each_table_is_rectangular_and_every_cell_of_the_study_stands_in_it() -> None:
    study = made_study()
    text = tables(study)
    for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        assert len({line.count(" | ") for line in block.splitlines()}) == 1
    for row in study["cells"]:
        if row["data"] in ("simulated", "real"):
            assert f"{row['right']:.2f} ({row['low']:.2f}-{row['high']:.2f})" in text


def test_what_was_not_computed_is_a_dash_or_no_row() -> None:
    study = made_study() | {"online": [], "online_shipped": [], "choices": [], "copies": []}
    for row in study["run_time"]:
        row["memory_bytes"] = None
    text = tables(study)
    assert "None" not in text
    assert text.count("## ") == 5
