"""The report as a reader meets it: every figure of the study in it, and nothing from elsewhere."""

import base64
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import pytest

from gestured.lab.study.report.page import FIGURES, write_report
from gestured.lab.study.report.reading import PROTOCOLS
from tests.lab.study.made_study import METHODS, Study, made_study

HOSTILE = "</td><script>alert('\"x\"')</script>&"


class Reader(HTMLParser):
    """The page as elements: checks that they close, and collects each table row's cells."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.elements: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.add(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if {"td", "th"} & set(self.open):
            self.rows[-1][-1] += data


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    reader.close()
    assert reader.open == []
    return reader


@pytest.fixture(scope="module")
def study() -> Study:
    return made_study()


@pytest.fixture(scope="module")
def page(study: Study, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(study, tmp_path_factory.mktemp("report"))


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are left out: they are most of a page's work."""
    for title in list(FIGURES):
        monkeypatch.delitem(FIGURES, title)


def test_every_figure_is_drawn_and_the_page_needs_nothing_else(page: Path) -> None:
    text = page.read_text("utf-8")
    pictures = re.findall(r'src="data:image/svg\+xml;base64,([^"]*)"', text)
    assert len(pictures) == len(FIGURES) == text.count("src=")
    for picture in pictures:
        drawn = base64.b64decode(picture).decode()
        assert ElementTree.fromstring(drawn).tag.endswith("svg")
        assert not re.search(r"\b(nan|inf|None)\b", drawn)
    assert not re.search(r"href|@import|<script", text)


def test_every_cell_of_the_main_tables_stands_in_the_row_of_its_method(page: Path, study: Study) -> None:
    rows = read(page.read_text("utf-8")).rows
    for cell in study["cells"]:
        about = [METHODS[cell["method"]][0], cell["settings"], cell["augmentation"]]
        (row,) = [row for row in rows if row[:3] == about]
        found = row[4 + list(PROTOCOLS).index(cell["protocol"])]
        assert found == f"{cell['right']:.2f} ({cell['low']:.2f}-{cell['high']:.2f}) ±{cell['spread']:.3f}"
        if cell["published"] is not None:
            assert row[3] == f"{cell['published']:.2f}"


def test_all_else_is_told(page: Path, study: Study) -> None:
    cells = {cell for row in read(page.read_text("utf-8")).rows for cell in row}
    assert any(study["data"]["real"]["name"] in cell for cell in cells)
    told = [study["machine"]["cpu"], "neighbours = 7"]
    told += [row["choice"] for row in study["choices"]] + [about["title"] for about in study["methods"].values()]
    told += ["C = 128, gamma = 0.000488; shift: C = 512, gamma = 0.0001221"]
    told += [f"{row['cold_us']:.0f}" for row in study["run_time"]]
    told += [f"{row['false_per_minute']:.2f}" for row in study["online"] + study["online_shipped"]]
    assert set(told) <= cells


def test_the_markdown_has_the_same_tables(page: Path) -> None:
    text = page.with_name("tables.md").read_text("utf-8")
    rows = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in text.splitlines() if line[:2] == "| "]
    assert rows == [[cell.strip() for cell in row] for row in read(page.read_text("utf-8")).rows]
    for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        assert len({line.count(" | ") for line in block.splitlines() if "---" not in line}) == 1


def test_what_was_not_computed_is_a_dash_or_no_table(tmp_path: Path, undrawn: None) -> None:
    study = made_study() | {"online": [], "online_shipped": [], "choices": [], "tuning": []}
    study["data"] |= {"real": None, "foreign": None}
    study["about"]["quick"] = True
    for row in study["run_time"]:
        row["memory_bytes"] = None
    study["cells"] = [cell for cell in study["cells"] if cell["protocol"] != "real"]
    page = write_report(study, tmp_path).read_text("utf-8")
    assert "None" not in page and "Continuous sessions" not in page and "A quick run" in page


def test_no_word_of_a_study_becomes_markup(tmp_path: Path, undrawn: None) -> None:
    study = made_study()
    study["data"]["foreign"]["name"] = study["machine"]["cpu"] = study["about"]["command"] = HOSTILE
    reader = read(write_report(study, tmp_path).read_text("utf-8"))
    assert "script" not in reader.elements and ["cpu", HOSTILE] in reader.rows


def test_a_program_that_draws_nothing_does_not_load_what_draws() -> None:
    code = "import gestured.lab.cli, sys; print(sorted({'matplotlib', 'jinja2'} & set(sys.modules)))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"
