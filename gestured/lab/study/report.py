"""The report: study.json as Markdown with its pictures, and the table of which model to take."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader

from gestured.lab import drawing
from gestured.lab.study import picture
from gestured.lab.study.picture import Row, Study
from gestured.lab.written import write

EMPTY = re.compile(r"^### .*\n\n(?:[^|\n].*\n\n)?(?:^\|.*\n){2}(?!\|)\n?", re.MULTILINE)  # a table without a row
PROTOCOLS = {
    "paper": "paper's protocol", "padded": "padded to the longest", "clean": "clean split",
    "participants": "participants held out", "real": "real, subjects held out", "foreign": "another generator",
}  # fmt: skip
CHOICES = {  # by method, when to take the model of it that ships
    "cnn_lstm": "you have no reason to take another: `gestured` runs it unless told otherwise",
    "lstm": "the first cannot be used; it is its fallback",
    "tp_rf": "neither network can be used; it mostly says `unknown`, so that it is seldom wrong",
}
HEAD = (
    "| take | if | % wrong: simulated, another generator, real | % wrong or lost (95 % over people) "
    "| a decision, cold | false events a minute |",
    "|---|---|---|---|---|---|",
)


def write_report(study: Study, out: Path) -> Path:
    """Write out/tables.md and the pictures beside it. Returns the path of the tables.

    `study` is what `gestured-lab study` writes as study.json.
    """
    templates = Environment(loader=PackageLoader("gestured.lab.study", "."), trim_blocks=True)
    templates.filters["values"] = values
    path, template = out / "tables.md", templates.get_template("tables.md")
    told = template.render(study=study, protocols=PROTOCOLS, lines=lines(study))
    write(path, EMPTY.sub("", told))
    with drawing.styled():
        write(out / "confusion.svg", drawing.svg(picture.confusion(study), picture.CONFUSION))
    if study["run_time"]:
        picture.write_picture(study, out)
    return path


def lines(study: Study) -> dict[tuple[str, str, str], dict[str, Row]]:
    """The cells by protocol, for each method, settings and augmentation: the lines of the main table."""
    found: dict[tuple[str, str, str], dict[str, Row]] = {}
    for row in study["cells"]:
        found.setdefault((row["method"], row["settings"], row["augmentation"]), {})[row["protocol"]] = row
    return found


def values(hyperparameters: Mapping[str, Any] | None) -> str:
    """Hyperparameters as a text; if they depend on the augmentation, with those that differ from the first."""
    found = dict(hyperparameters or {})
    if not found or not all(isinstance(value, Mapping) for value in found.values()):
        told = {name: f"{value:.4g}" if isinstance(value, float) else value for name, value in found.items()}
        return ", ".join(f"{name} = {value}" for name, value in told.items()) or "–"
    known, *others = found.items()
    return "; ".join([values(known[1]), *(f"{name}: {values(of)}" for name, of in others if of != known[1])])


def choice(study: Study) -> list[str]:
    """Lines of Markdown: the models that ship, and when to take which; a model that was not timed is left out."""
    rows = {row["method"]: row for row in study["run_time"] if row["settings"] == "shipped"}
    false = {row["method"]: f"{row['false_per_minute']:.4g}" for row in study["online_shipped"]}
    told = list(HEAD)
    for method, when in CHOICES.items():
        if row := rows.get(method):
            fields = [row["fields"].get(field, {}) for field in picture.FIELDS]
            wrong = ", ".join(_percent(of.get("wrong")) for of in fields)
            error = ", ".join(_with_interval(of) for of in fields)
            parts = picture.title(study, method), when, wrong, error, f"{row['cold_us'] / 1000:.2f} ms"
            told.append(f"| {' | '.join(parts)} | {false.get(method, '–')} |")
    return told


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.1f}"


def _with_interval(of: Row) -> str:
    """A field's error in per cent, and its interval if it has one."""
    ends = "–".join(_percent(of[f"error_{end}"]) for end in ("low", "high") if f"error_{end}" in of)
    return _percent(of.get("error")) + (f" ({ends})" if ends else "")
