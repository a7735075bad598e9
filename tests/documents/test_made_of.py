"""Tables that a command has printed are of the models in this checkout, or say that they are not."""

import re
import resource
from pathlib import Path

import pytest

from experiments.figures import made, with_data
from experiments.same import alike, compared, streams, told, write
from gestured.core.errors import GesturedError
from gestured.lab.made_of import LINE, OLDER, command_of, made_of, renew, signed
from gestured.lab.recordings.origin import said
from gestured.model.shipped import shipped
from tests.documents.blocks import ROOT, documents

BLOCK = re.compile(r"^<!-- ([^:\n]+): begin -->\n(.*?)^<!-- \1: end -->$", re.MULTILINE | re.DOTALL)
CARDS = [path.with_suffix(".md") for path in shipped().values()]


def edited(text: str) -> list[str]:
    """The names of the blocks of a text that are not as their command has written them."""
    blocks = ((name, block.splitlines()) for name, block in BLOCK.findall(text))
    return [name for name, lines in blocks if any("; block " in line for line in lines) and signed(lines) != lines]


def test_no_table_outlives_its_models() -> None:
    assert [one for one in made(ROOT) if "made of another" in one.why] == []


@pytest.mark.parametrize("path", [*documents(), *CARDS], ids=lambda path: path.name)
def test_every_generated_block_says_what_it_was_made_of_and_none_was_edited(path: Path) -> None:
    assert edited(path.read_text()) == []
    blocks = [block for _, block in BLOCK.findall(path.read_text()) if OLDER not in block]
    for block in blocks:
        made = LINE.search(block)
        assert made and "; block " in made[0]
        assert made[1].startswith(("make bench ", "gestured-lab ", "python -m experiments."))


def test_an_edited_figure_is_found(tmp_path: Path) -> None:
    page, model = tmp_path / "page.md", tmp_path / "cnn_lstm.onnx"
    model.write_bytes(b"one")
    page.write_text("before\n<!-- figures: begin -->\n<!-- figures: end -->\nafter\n")
    renew(page, "figures", [made_of("make it", [model]), "", "| right | 0.91 |\n| wrong | 0.02 |"])
    assert edited(page.read_text()) == []
    page.write_text(page.read_text().replace("0.91", "0.92"))
    assert edited(page.read_text()) == ["figures"]
    with pytest.raises(GesturedError, match="2 rows of tables, and 1 would replace"):
        renew(page, "figures", [made_of("make it", [model]), "", "| right | 0.91 |"])
    assert edited(page.read_text()) == ["figures"]


def test_a_page_for_which_there_is_no_room_stays_as_it_was(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(before := "what somebody wrote\n<!-- figures: begin -->\n<!-- figures: end -->\n")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before), limits[1]))  # EFBIG in place of a full disk's ENOSPC
    try:
        with pytest.raises(OSError, match="File too large"):
            renew(page, "figures", ["| right | 0.91 |"] * 100)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert page.read_text() == before and list(tmp_path.iterdir()) == [page]


@pytest.mark.parametrize("name", sorted(shipped()))
def test_a_card_is_its_models(name: str) -> None:
    card = shipped()[name].with_suffix(".md").read_text()
    of = made_of("gestured-lab evaluate", [shipped()[name]])
    assert re.findall(r"SHA-256 \| `([0-9a-f]{12})", card) == [LINE.fullmatch(of)[2].split()[-1]]  # type: ignore[index]
    learned = "real development recordings of CapFingerId" in card
    assert learned == any("capfingerid" in one.file for one in said(shipped()[name]) or [])


@pytest.mark.parametrize("name", sorted(shipped()))
def test_a_card_has_the_figures_on_another_generators_people_that_the_document_has(name: str) -> None:
    row = f"| `{name}.onnx`, another generator"
    card, figures = (
        [line for line in path.read_text().splitlines() if line.startswith(row)]
        for path in (shipped()[name].with_suffix(".md"), ROOT / "docs" / "figures.md")
    )
    assert card == figures and len(card) == 2


def test_a_page_names_no_folder_of_the_machine_that_made_its_table() -> None:
    words = "gestured-lab evaluate --cache /home/me/cache --real /home/me/data --jobs 2 --document docs/figures.md"
    assert command_of(words.split()) == "gestured-lab evaluate --real FOLDER --document docs/figures.md"


def test_a_table_of_other_models_or_of_other_code_is_listed(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "manifest.json").write_text("{}")
    line, page = made_of("make it", shipped().values()), tmp_path / "docs" / "page.md"
    page.write_text(f"{line}\n\n{line}\n{OLDER}\n")
    assert [one.why for one in made(tmp_path)] == ["", "says itself that it is older"]
    page.write_text(re.sub("(?<=code )[0-9a-f]{12}", "0" * 12, line) + "\n\n" + re.sub("; code .{12}", "", line))
    assert [one.why for one in made(tmp_path)] == ["made with other code", "does not say with which code"]
    page.write_text(f"\n{re.sub('(?<=cnn_lstm.onnx )[0-9a-f]{12}', '0' * 12, line)}\n{OLDER}\n")
    assert [(one.number, one.why) for one in made(tmp_path)] == [(2, "says itself that it is older")]
    page.write_text(page.read_text().replace(OLDER, ""))
    assert [(one.number, one.why) for one in made(tmp_path)] == [(2, "made of another cnn_lstm.onnx")]
    line = made_of("make it", [], ("gestured.core.where",))
    assert " of gestured.core.where" in line and "onnx" not in line
    page.write_text(line + "\n\n" + line.replace("core.where", "core.spots"))
    assert [one.why for one in made(tmp_path)] == ["", "made with other code"]


def test_code_that_decides_as_other_code_did_makes_no_table_older() -> None:
    lines = "# NOW BEFORE\nnow first 2026-11-28\nsecond first 2026-11-27\nother another 2026-11-29\n"
    assert all(alike(one, "now", lines) for one in ("now", "first", "second"))  # two that decide as a third do so alike
    assert not any(alike(one, "now", lines) for one in ("other", "another", "BEFORE"))
    assert not alike("NOW", "BEFORE", lines)


def test_two_checkouts_decide_alike_if_no_event_differs(tmp_path: Path) -> None:
    assert write(streams(range(0), 2, None), tmp_path) == 1
    _, *events = told(tmp_path, "cnn_lstm")
    assert compared(iter(events), iter(events), "") == len(events) > 4
    for wrong in (events[:-1], [*events[:2], "Onset(sensor='sensor0', id=1, onset=0.5)", *events[2:]]):
        with pytest.raises(GesturedError, match=r"event \d+ differs"):
            compared(iter(events), iter(wrong), "")
    one, other = (f"{{}}(id=1, reason='{why}', gates=())" for why in ("confidence", "context"))
    assert compared(iter([one.format("Unknown")]), iter([other.format("Unknown")]), "Unknown.reason") == 1
    with pytest.raises(GesturedError, match="event 1 differs"):
        compared(iter([one.format("Cancelled")]), iter([other.format("Cancelled")]), "Unknown.reason")


def test_a_figure_without_its_data_says_what_is_missing(tmp_path: Path) -> None:
    command = "gestured-lab evaluate --real FOLDER --document docs/figures.md"
    for folder in (None, tmp_path / "none"):
        assert "needs the folder of real recordings" in with_data(command, folder)
    assert with_data(command, tmp_path)[-4:] == ["--real", str(tmp_path), "--document", "docs/figures.md"]
    assert "none.npz, which is not here" in with_data(f"gestured-lab study --foreign {tmp_path / 'none.npz'}", None)
