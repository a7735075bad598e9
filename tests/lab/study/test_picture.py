"""The picture of error against run time: every point in it, drawn again from what is kept."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure

from gestured.core.errors import GesturedError
from gestured.lab import cli
from gestured.lab.digest import file_digest
from gestured.lab.made_of import OLDER, renew, stale
from gestured.lab.study.report.picture import FIELDS, write_picture
from gestured.model.shipped import shipped
from tests.lab.study.made_study import made_study


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The picture; drawing it takes seconds."""
    return write_picture(made_study(), tmp_path_factory.mktemp("first"))


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty picture, for tests of what is written beside it."""
    monkeypatch.setattr("gestured.lab.study.report.picture.operating_points", lambda study: Figure())


def test_it_names_models_in_every_field(first: Path) -> None:
    root = ElementTree.fromstring(first.read_text())
    words = {text.text for text in root.iter("{http://www.w3.org/2000/svg}text")}
    assert words >= set(FIELDS.values())
    assert words >= {"LSTM, ships", "CNN-LSTM, ships"}


def test_it_is_drawn_again_from_what_is_kept(first: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    again = tmp_path / "again"
    assert cli.main(["study", "--draw", str(first.with_name("operating-points.json")), "--out", str(again)]) == 0
    assert (again / first.name).read_text() == first.read_text()
    path, origin, *_ = capsys.readouterr().out.splitlines()
    assert Path(path).samefile(again / first.name) and stale(origin, again.iterdir()) == []
    assert not re.search(r"\b(nan|inf|None)\b", first.read_text())


def test_real_figures_of_the_models_that_ship_are_the_manifests(tmp_path: Path, undrawn: None) -> None:
    """A study that timed a model of this checkout takes them from there, intervals too; else it keeps its own."""
    study, kept = made_study(), tmp_path / "study.json"
    study["about"]["models"] = {name: file_digest(path) for name, path in shipped().items()} | {"lstm": "0" * 64}
    kept.write_text(json.dumps(study))
    assert cli.main(["study", "--draw", str(kept), "--out", str(tmp_path)]) == 0
    drawn = json.loads((tmp_path / "operating-points.json").read_text())["run_time"]
    names = [(row["method"], row["settings"]) for row in study["run_time"]]
    found = drawn.pop(k := names.index(("cnn_lstm", "shipped")))["fields"]["real"]
    study["run_time"].pop(k)
    assert drawn == study["run_time"]
    figures = json.loads((shipped()["cnn_lstm"].parent / "manifest.json").read_text())["models"]["cnn_lstm.onnx"]
    real = figures["figures"]["real"]["taps and swipes"]
    assert found["performed"] == real["gestures"] and found["wrong"] == pytest.approx(real["wrong"], abs=1e-4)
    assert found["error"] == pytest.approx(1 - real["right"], abs=1e-4)
    assert found["wrong_low"] < found["wrong"] < found["wrong_high"]
    assert found["error_low"] < found["error"] < found["error_high"]


def test_the_table_below_it_is_put_into_a_document_and_only_there(tmp_path: Path, undrawn: None) -> None:
    study, kept, page = made_study(), tmp_path / "study.json", tmp_path / "figures.md"
    kept.write_text(json.dumps(study))
    page.write_text("before\n<!-- choice: begin -->\nold\n<!-- choice: end -->\nafter\n")
    assert cli.main(["study", "--draw", str(kept), "--out", str(tmp_path), "--document", str(page)]) == 0
    first, *block, last = page.read_text().splitlines()
    assert (first, last) == ("before", "after") and "old" not in block
    ships = next(line for line in block if line.startswith("| CNN-LSTM |"))
    (row,) = [r for r in study["run_time"] if (r["method"], r["settings"]) == ("cnn_lstm", "shipped")]
    wrong = [f"{100 * row['fields'][field]['wrong']:.1f}" for field in FIELDS]
    simulated = row["fields"]["simulated"]
    error, low, high = (f"{100 * simulated[name]:.1f}" for name in ("error", "error_low", "error_high"))
    assert ships.split(" | ")[3].startswith(f"{error} ({low}–{high}), ")
    assert ships.split(" | ")[2] == ", ".join(wrong) and ships.endswith("| 0.31 |")
    assert len({line.count("|") for line in block if line.startswith("|")}) == 1


def test_a_document_without_marks_is_left_alone(tmp_path: Path) -> None:
    page = tmp_path / "figures.md"
    page.write_text("no marks\n")
    with pytest.raises(GesturedError, match="choice: begin"):
        renew(page, "choice", ["new"])
    assert page.read_text() == "no marks\n"


def test_what_is_no_study_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.json"
    path.write_text(json.dumps({"about": {}}))
    assert cli.main(["study", "--draw", str(path), "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err.startswith(f"gestured-lab: --draw: {path}: expected study.json")


def test_a_picture_names_the_command_that_draws_it_and_no_folder_of_its_data(
    tmp_path: Path, undrawn: None, capsys: pytest.CaptureFixture[str]
) -> None:
    """And its table says so where the models that were measured are not those that ship."""
    study, kept = made_study(), tmp_path / "study.json"
    for models, older in (({}, True), ({name: file_digest(path) for name, path in shipped().items()}, False)):
        study["about"] |= {"models": models, "command": "gestured-lab study --real /home/somebody/data"}
        kept.write_text(json.dumps(study))
        assert cli.main(["study", "--draw", str(kept), "--out", str(tmp_path)]) == 0
        said = capsys.readouterr().out
        assert "made by `gestured-lab study --draw " in said and (OLDER in said) == older
        about = json.loads((tmp_path / "operating-points.json").read_text())["about"]
        assert about["command"] == "gestured-lab study --real FOLDER"
