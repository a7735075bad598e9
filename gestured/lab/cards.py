"""Model cards: what a shipped model is, what it learned from, what it is worth and where it ends."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader

from gestured.lab.made_of import kept, made_of, renew
from gestured.lab.manifest import NAME
from gestured.lab.recordings.origin import said
from gestured.lab.train import TrainingPlan
from gestured.model.opening import open_model


def write_cards(folder: Path, figures: Mapping[str, Mapping[str, Any]], plan: TrainingPlan) -> None:
    """One Markdown file beside each model."""
    for name, found in figures.items():
        (folder / f"{name}.md").write_text(_card(folder / f"{name}.onnx", name, found, plan))


def write_block(document: Path, folder: Path, figures: Mapping[str, Mapping[str, Any]]) -> None:
    """Renew the table of a folder's models in a document; GesturedError where its marks are missing."""
    files = [*(folder / f"{name}.onnx" for name in figures), folder / NAME]
    rows = [row for name, found in figures.items() for row in _rows(found, f"`{name}.onnx`, ")]
    real = " --real FOLDER" if any("real" in found for found in figures.values()) else ""
    command = f"gestured-lab evaluate{real} --document docs/figures.md"
    renew(document, "figures", [made_of(command, files), "", *HEAD, *rows])


MEASURED_APART = ("unseen", "judged")  # parts of a card between marks, which experiments write
HEAD = (
    "| set | gestures | right\\* | right | wrong | lost | non-gestures | rejected |",
    "|---|---|---|---|---|---|---|---|",
)


def _card(path: Path, name: str, found: Mapping[str, Any], plan: TrainingPlan) -> str:
    templates = Environment(loader=PackageLoader("gestured.lab", "."), keep_trailing_newline=True)
    apart = (kept(path.with_suffix(".md"), part) for part in MEASURED_APART)
    return templates.get_template("card.md").render(
        name=name, model=open_model(path), plan=plan, settings=asdict(plan.fit), real=bool(said(path)),
        table=[*HEAD, *_rows(found)], others=list(filter(None, apart)),
    )  # fmt: skip


def _rows(found: Mapping[str, Any], before: str = "") -> list[str]:
    """A row for each set that a model was judged on; `before` stands before its name."""
    sets = {f"simulated, {test}": values for test, values in found["simulated"].items()}
    sets |= {f"real, {test}": values for test, values in found.get("real", {}).items() if test != "kinds"}
    return [_row(f"{before}{title}", values) for title, values in sets.items()]


def _row(title: str, values: Mapping[str, Any]) -> str:
    ends = values["intervals"]
    shares = " | ".join(with_interval(values[n], ends[n]) for n in ("right", "wrong", "lost"))
    rejected = with_interval(values["rejected"], ends["rejected"]) if values["others"] else "-"
    before = f"{values['right_before']:.3f}"
    return f"| {title} | {values['gestures']} | {before} | {shares} | {values['others']} | {rejected} |"


def with_interval(share: float, ends: Mapping[str, float]) -> str:
    """A share and, in brackets, where its interval begins and ends."""
    return f"{share:.3f} ({ends['low']:.3f}–{ends['high']:.3f})"
