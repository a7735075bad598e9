"""The report: tables.md, and the figures that it shows."""

import re
from pathlib import Path

from jinja2 import Environment, PackageLoader

from . import drawing, figures, formats, picture, reading
from .reading import Study

EMPTY = re.compile(r"^### .*\n\n(?:[^|\n].*\n\n)?(?:^\|.*\n){2}(?!\|)\n?", re.MULTILINE)  # a table without a row


def write_report(study: Study, out: Path) -> Path:
    """Write out/tables.md and the pictures beside it. Returns the path of the tables.

    `study` is what `gestured-lab study` writes as study.json.
    """
    templates = Environment(loader=PackageLoader("gestured.lab.study", "report"), trim_blocks=True)
    templates.filters["values"] = formats.values
    path = out / "tables.md"
    path.write_text(EMPTY.sub("", templates.get_template("tables.md").render(study=study, reading=reading)), "utf-8")
    with drawing.styled():
        (out / "confusion.svg").write_text(drawing.svg(figures.confusion(study), figures.TITLE), "utf-8")
    if study["run_time"]:
        picture.write_picture(study, out)
    return path
