"""The report as a reader meets it: every figure of the study in its tables, its pictures, the table of choices."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure

from gestured.lab.study.picture import FIELDS
from gestured.lab.study.report import PROTOCOLS, choice, write_report
from tests.lab.study.made_study import METHODS, Study, made_study


@pytest.fixture(scope="module")
def study() -> Study:
    return made_study()


@pytest.fixture(scope="module")
def report(study: Study, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(study, tmp_path_factory.mktemp("report"))


def rows_of(report: Path) -> list[list[str]]:
    lines = [line for line in report.read_text("utf-8").splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split(" |")] for line in lines]


def test_every_picture_that_it_shows_is_drawn(report: Path) -> None:
    shown = re.findall(r"!\[.+\]\((.*)\)", report.read_text("utf-8"))
    assert sorted(shown) == sorted(path.name for path in report.parent.glob("*.svg"))
    for name in shown:
        drawn = report.with_name(name).read_text("utf-8")
        assert ElementTree.fromstring(drawn).tag.endswith("svg")
        assert not re.search(r"\b(nan|inf|None)\b", drawn)


def test_the_picture_names_what_ships_in_every_field(report: Path) -> None:
    root = ElementTree.parse(report.with_name("operating-points.svg")).getroot()
    words = {text.text for text in root.iter("{http://www.w3.org/2000/svg}text")}
    assert words >= {*FIELDS.values(), "LSTM, ships", "CNN-LSTM, ships"}


def test_who_takes_which_model(study: Study) -> None:
    lines = choice(study)
    ships = next(line for line in lines if line.startswith("| CNN-LSTM |"))
    (row,) = [r for r in study["run_time"] if (r["method"], r["settings"]) == ("cnn_lstm", "shipped")]
    wrong = [f"{100 * row['fields'][field]['wrong']:.1f}" for field in FIELDS]
    simulated = row["fields"]["simulated"]
    error, low, high = (f"{100 * simulated[name]:.1f}" for name in ("error", "error_low", "error_high"))
    assert ships.split(" | ")[3].startswith(f"{error} ({low}–{high}), ")
    assert ships.split(" | ")[2] == ", ".join(wrong) and ships.endswith("| 0.31 |")
    assert len({line.count("|") for line in lines}) == 1


def test_every_cell_of_the_main_tables_stands_in_the_row_of_its_method(report: Path, study: Study) -> None:
    rows = rows_of(report)
    for cell in study["cells"]:
        about = [METHODS[cell["method"]][0], cell["settings"], cell["augmentation"]]
        (row,) = [row for row in rows if row[:3] == about]
        found = row[4 + list(PROTOCOLS).index(cell["protocol"])]
        assert found == f"{cell['right']:.2f} ({cell['low']:.2f}-{cell['high']:.2f}) ±{cell['spread']:.3f}"
        if cell["published"] is not None:
            assert row[3] == f"{cell['published']:.2f}"


def test_how_speed_and_inclination_matter_stands_in_the_row_of_each_method(report: Path, study: Study) -> None:
    rows = rows_of(report)
    assert ["method", *study["trials"][0]["speed"], "tilted 0°", "tilted 30°", "tilted 60°"] in rows
    for one in study["trials"]:
        shares = [*one["speed"].values(), *one["inclination"].values()]
        assert [METHODS[one["method"]][0], *(f"{share:.2f}" for share in shares)] in rows


def test_all_else_is_told(report: Path, study: Study) -> None:
    cells = {cell for row in rows_of(report) for cell in row}
    told = (
        ["neighbours = 7"]
        + [row["choice"] for row in study["choices"]]
        + [about["title"] for about in study["methods"].values()]
    )
    told += ["C = 128, gamma = 0.000488; shift: C = 512, gamma = 0.0001221"]
    told += [f"{row['cold_us']:.0f}" for row in study["run_time"]]
    told += [f"{row['false_per_minute']:.2f}" for row in study["online"] + study["online_shipped"]]
    assert set(told) <= cells
    for block in re.findall(r"(?:^\|.*\n)+", report.read_text("utf-8"), re.MULTILINE):
        assert len({line.count(" | ") for line in block.splitlines() if "---" not in line}) == 1


def test_what_was_not_computed_is_a_dash_or_no_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gestured.lab.study.picture.confusion", lambda study: Figure())
    study = made_study() | {"online": [], "online_shipped": [], "choices": [], "run_time": []}
    study["data"] |= {"real": None, "foreign": None}
    study["about"]["quick"] = True
    study["cells"] = [cell for cell in study["cells"] if cell["protocol"] != "real"]
    text = write_report(study, tmp_path).read_text("utf-8")
    assert "None" not in text and "Continuous sessions" not in text and "run time" not in text
    assert "A quick run" in text
