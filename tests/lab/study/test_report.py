"""The report as a reader meets it: everything there, nothing from elsewhere, the numbers true, said when missing."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from gestured.lab.study.report.page import write_report
from tests.lab.study.made_study import LISTS, NAMES, empty_study, made_study, small_study

Study = dict[str, Any]
HOSTILE = "</script></style><script>alert('\"x\"')</script>&\x00\ud800"
MAY_BE_NULL = [
    ("low", "high"),
    ("p95_us", "memory_bytes", "file_bytes", "latency_ms", "error"),
    ("published", "confusion", "paper"),
    ("gain_leaky", "gain_clean", "right_with_copy", "spread"),
    ("snapshots", "minutes", "torch"),
]
VOID = {"meta", "br"}


class Reader(HTMLParser):
    """The page as elements: checks that they close, and collects the text of each row and caption."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.rows: list[str] = []
        self.heads_without_scope = 0
        self.scripts = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.ids += [found["id"] or ""] if "id" in found else []
        self.links += [found["href"] or ""] if "href" in found else []
        self.heads_without_scope += tag == "th" and found.get("scope") not in ("row", "col")
        self.scripts += tag == "script"
        if tag == "tr":
            self.rows.append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.ids += [found["id"] or ""] if "id" in found else []
        self.links += [found["href"] or ""] if "href" in found else []

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "tr" in self.open and "svg" not in self.open:
            self.rows[-1] += data + " "


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    reader.close()
    assert reader.open == []
    return reader


def drawings(page: str) -> list[ElementTree.Element]:
    """What is drawn, but for the symbols that drawings share."""
    return [ElementTree.fromstring(found) for found in re.findall(r'<svg (?!class="hidden").*?</svg>', page, re.DOTALL)]


def text(page: str) -> str:
    return re.sub(r"<[^>]*>", "", page.split("<main>")[1])


@pytest.fixture(scope="module")
def study() -> Study:
    return made_study()


@pytest.fixture(scope="module")
def page(study: Study, tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_report(study, tmp_path_factory.mktemp("report")).read_text("utf-8")


def report(study: Study, out: Path) -> str:
    path = write_report(study, out)
    assert path == out / "index.html"
    return path.read_text("utf-8")


def test_it_is_well_formed_and_its_contents_lead_somewhere(page: str) -> None:
    reader = read(page)
    assert reader.heads_without_scope == 0
    assert len(reader.links) >= 12
    assert {link.removeprefix("#") for link in reader.links} <= set(reader.ids)
    assert len(reader.ids) == len(set(reader.ids))


def test_every_drawing_is_valid_xml_and_says_in_words_what_it_shows(page: str) -> None:
    drawn = drawings(page)
    assert len(drawn) > 100
    for root in drawn:
        title = root.findtext("title")
        assert root.get("role") == "img" and title and title.strip()
        assert not re.search(r"\b(nan|inf|None)\b", ElementTree.tostring(root, "unicode"))


def test_every_chart_follows_the_theme_and_the_font_of_the_page(page: str) -> None:
    charts = [root for root in drawings(page) if root.get("class") == "chart"]
    assert len(charts) > 20
    for root in charts:
        drawn = ElementTree.tostring(root, "unicode")
        assert "var(--ink)" in drawn or "var(--soft)" in drawn
        assert not re.search(r"(?:fill|stroke)[:=]\"? ?#", drawn), root.findtext("title")
        assert root.findall(".//text") and not root.findall(".//image")


def test_nothing_is_fetched_and_all_stands_in_one_file(page: str, tmp_path: Path) -> None:
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!#)""", page)
    assert not re.search(r"//[a-z]|url\((?!#)|@import", page.split("<script>")[0])
    assert not re.search(r"fetch|XMLHttp|import\b", page.split("<script>")[1])
    write_report({}, tmp_path / "deep" / "report")
    assert {path.name for path in (tmp_path / "deep" / "report").iterdir()} == {"index.html", "tables.md"}


def test_every_cell_of_the_tables_stands_in_the_row_of_its_method(page: str, study: Study) -> None:
    rows = read(page).rows
    for cell in study["cells"]:
        title = NAMES[cell["method"]]
        figure = f"{100 * cell['right']:.1f}"
        interval = f"{100 * cell['low']:.1f}–{100 * cell['high']:.1f}"
        settings = "tuned" if cell["settings"] == "tuned" else "the paper's"
        assert any(title in row and figure in row and interval in row and settings in row for row in rows), cell


def test_published_figures_stand_beside_ours(page: str, study: Study) -> None:
    rows = read(page).rows
    for cell in study["cells"] + study["online"] + study["online_shipped"]:
        if cell.get("published") is not None:
            title, figure = NAMES[cell["method"]], f" {100 * cell['published']:.0f} "
            assert any(title in row and figure in row for row in rows), cell


def test_every_figure_of_the_schema_is_drawn(page: str, study: Study) -> None:
    drawn = [root.findtext("title") or "" for root in drawings(page)]
    drawn += re.findall(r'<table class="matrix" aria-label="([^"]*)"', page)
    wanted = ["The published figures and ours", "Error against run time", "Error against elapsed", "Learning curves"]
    wanted += ["A double tap's pressure over time"]
    for part, words in (("calibration", "Reliability diagram of"), ("methods", "Confusion matrix of")):
        methods = [row["method"] for row in study[part]] if part == "calibration" else list(study["methods"])
        wanted += [f"{words} {NAMES[method]}" for method in methods]
    wanted += [gesture.replace("_", " ") + ": raw signal" for gesture in study["signals"]]
    wanted += [f"By {by}" for by in {row["by"] for row in study["failures"]}]
    for words in wanted:
        found = [title for title in drawn if title.startswith(words)]
        assert found and all("simulated" in title or "real" in title for title in found), words


def test_drawings_hold_all_points(page: str, study: Study) -> None:
    for row in study["run_time"]:
        title = NAMES[row["method"]]
        told = f"{title} ({row['settings']}, {row['precision']}): {100 * (1 - row['right']):.1f}\u202f% wrong in "
        assert told in page
    assert page.count("<title>the frame after ") == len(study["double_tap"]["snapshots"])


def test_each_method_s_groups_are_in_figures_and_the_best_of_each_family_is_drawn(page: str, study: Study) -> None:
    rows = [" ".join(row.split()) for row in read(page).rows]
    for row in study["failures"]:
        figures = [f"{100 * g['right']:.1f} {100 * g['low']:.1f}–{100 * g['high']:.1f}" for g in row["groups"]]
        assert f"{NAMES[row['method']]} {' '.join(figures)}" in rows
    for method, drawn in {"tp_rf": True, "lstm": False, "cnn_lstm": True}.items():  # made weaker than CNN-LSTM
        assert (f">{NAMES[method]}, one tap: " in page) == drawn


def test_all_else_is_told(page: str, study: Study) -> None:
    words = text(page)
    told = [study["about"]["command"], study["machine"]["cpu"], study["data"]["real"]["name"]]
    told += [row["reason"] for row in study["data"]["left_out"]] + [row["choice"] for row in study["choices"]]
    told += [option["value"] for row in study["choices"] for option in row["alternatives"]]
    told += [f"C = {row['chosen']['C']:g}" for row in study["tuning"]]
    told += [about["title"] for about in study["methods"].values()] + ["shift: C = 512, gamma = 0.0001221"]
    for some in told:
        assert some in words


def test_the_summary_counts_what_reproduces(tmp_path: Path) -> None:
    study = made_study()
    cells = [c for c in study["cells"] if c["protocol"] == "participants" and c["settings"] == "paper"]
    compared = [cell for cell in cells if cell["published"] is not None]
    for k, cell in enumerate(compared):
        cell.update(right=cell["published"] - (0.2 if k < 3 else 0.01), low=0.0, high=0.1)
    words = text(report({name: study[name] for name in ("methods", "cells")}, tmp_path))
    assert f"{len(compared) - 3} of {len(compared)} on people never seen" in words
    short = words.split("Lower than published")[1].split(".")[0]
    assert short.count("→") == 3


def test_the_summary_says_how_much_of_the_gain_is_copies(tmp_path: Path) -> None:
    study = made_study()
    for row in study["copies"]:
        row.update(gain_leaky=0.2, gain_clean=0.05, test=100, with_copy=40, with_version=90)
    words = text(report({name: study[name] for name in ("methods", "copies")}, tmp_path))
    assert "+20.0 points" in words and "+5.0" in words
    assert "75\u202f% of the gain is owed" in words and "40\u202f% of them unchanged, and 90\u202f% shifted" in words


@pytest.mark.filterwarnings("ignore:constrained_layout not applied")
def test_no_string_of_the_study_becomes_markup(tmp_path: Path) -> None:
    def spoilt(value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            return {name: spoilt(inner, name) for name, inner in value.items()}
        if isinstance(value, list):
            return [spoilt(inner, key) for inner in value]
        kept = ("method", "settings", "augmentation", "protocol", "data", "family", "precision", "by")
        return value + HOSTILE if isinstance(value, str) and key not in kept else value

    page = report(spoilt(small_study()), tmp_path)
    reader = read(page)
    assert reader.scripts == 1
    assert len(drawings(page)) > 20
    assert "alert" in text(page)


def test_a_study_without_anything_says_what_is_missing(tmp_path: Path) -> None:
    words = text(report(empty_study(), tmp_path))
    missing: tuple[str, ...] = (
        "tables of the paper",
        "Copies",
        "Sessions",
        "Confusions",
        "Run times",
        "elapsed time",
        "methods fail",
    )
    missing += ("Calibration", "Learning curves", "Signals", "double tap", "Methods", "Hyperparameters", "open choices")
    for part in missing:
        assert re.search(rf"[^.]*{part}[^.]* not computed in this run", words, re.IGNORECASE), part
    assert "no real recording was used" in words and "Nothing was left out" in words
    assert "None" not in words and "nan" not in words


@pytest.mark.parametrize("part", [*LISTS, "signals", "double_tap", "data", "machine", "methods", "about"])
def test_any_part_may_be_missing(part: str, tmp_path: Path, undrawn: None) -> None:
    read(report({**small_study(), part: None}, tmp_path))


def test_a_study_may_be_empty(tmp_path: Path) -> None:
    assert "not computed" in report({}, tmp_path)


@pytest.mark.parametrize("names", MAY_BE_NULL, ids=" ".join)
def test_single_figures_may_be_missing(names: tuple[str, ...], tmp_path: Path) -> None:
    study = small_study()
    for name in names:
        _null(study, name)
    assert "None" not in text(report(study, tmp_path))


def _null(value: Any, name: str) -> None:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    for item in inner:
        _null(item, name)
    if isinstance(value, dict) and name in value:
        value[name] = None


def test_a_quick_run_says_that_its_figures_mean_nothing(study: Study, page: str, tmp_path: Path) -> None:
    quick = {"about": {**study["about"], "quick": True}}
    assert "A quick run" in text(report(quick, tmp_path)) and "A quick run" not in text(page)


def test_the_same_study_gives_the_same_page(tmp_path: Path) -> None:
    assert report(small_study(), tmp_path / "first") == report(small_study(), tmp_path / "second")


def _luminance(colour: str) -> float:
    """Relative luminance of #rrggbb (WCAG 2.1)."""
    channels = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return sum(weight * c for weight, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def _contrast(one: str, other: str) -> float:
    darker, lighter = sorted((_luminance(one), _luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize("scheme", [0, 1], ids=["light", "dark"])
def test_words_and_marks_stand_out_from_the_page(scheme: int, page: str) -> None:
    colours = dict(re.findall(r"--(\w+): (#\w{6});", page.split(":root {")[1 + scheme].split("}")[0]))
    for ground in ("page", "card"):
        for words in ("ink", "soft", "link", "f0"):
            assert _contrast(colours[words], colours[ground]) >= 4.5, (words, ground)
    for mark in ("f0", "f1", "f2", "f3", "f4", "deep"):
        assert _contrast(colours[mark], colours["page"]) >= 3.0, mark


def test_own_recordings_have_tables_of_their_own_and_change_no_other_figure(
    study: Study, tmp_path: Path, undrawn: None
) -> None:
    base = {name: study[name] for name in ("about", "methods", "data", "cells", "copies")}
    page = report(base, tmp_path)
    mine = [
        {**cell, "data": "own", "published": None, "right": 0.1234, "low": 0.1, "high": 0.2}
        for cell in study["cells"]
        if (cell["protocol"], cell["augmentation"]) == ("participants", "none")
    ]
    with_own = report({**base, "cells": [*mine, *study["cells"]]}, tmp_path)
    rows = [row for row in read(with_own).rows if "12.3 10.0–20.0" in " ".join(row.split())]
    assert len(rows) == len(mine) and "Your own recordings" in with_own and "Your own recordings" not in page
    parts = re.compile(r'<dl class="findings">.*?</dl>', re.DOTALL)
    assert parts.search(with_own)[0] == parts.search(page)[0]  # type: ignore[index]


def test_times_before_the_onset_stay_within_their_drawing(tmp_path: Path) -> None:
    study = made_study()
    for signal in [*study["signals"].values(), study["double_tap"]]:
        signal["times_s"] = [time - 0.3 for time in signal["times_s"]]
    page = report({name: study[name] for name in ("about", "signals", "double_tap")}, tmp_path)
    curves = [root for root in drawings(page) if root.get("class") == "chart"]
    assert len(curves) == 11
    for root in curves:
        places = [float(x) for path in root.iter("path") for x in re.findall(r"[ML] (\S+) ", path.get("d") or "")]
        assert min(places) >= 0 and max(places) <= float(root.get("width") or 0)
    assert "\u22120.3 s" in page


def test_a_program_that_draws_nothing_does_not_load_what_draws() -> None:
    code = "import gestured.lab.cli, sys; print(sorted({'matplotlib', 'jinja2'} & set(sys.modules)))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"
