"""The page and tables.md: a study's figures and tables, in one file each."""

import base64
import re
from pathlib import Path

from jinja2 import Environment, PackageLoader, select_autoescape

from . import drawing, figures, formats, picture, reading
from .reading import Study

FIGURES = {  # title -> the part of the study that it needs, and how it is drawn
    "The published figures and ours": ("cells", figures.overview),
    picture.TITLE: ("run_time", lambda study: picture.operating_points(picture.points(study))),
    "Which gesture is taken for which": ("cells", figures.confusion),
}
TABLE = re.compile(r"^### (?P<title>.*)\n\n(?:(?P<notes>[^|].*)\n\n)?(?P<lines>(?:^\|.*\n)+)", re.MULTILINE)
EMPTY = re.compile(r"^### .*\n\n(?:[^|\n].*\n\n)?(?:^\|.*\n){2}(?!\|)\n?", re.MULTILINE)  # a table without a row


def write_report(study: Study, out: Path) -> Path:
    """Write out/index.html, which needs nothing else and no network, and out/tables.md. Returns the page's path.

    `study` is what `gestured-lab study` writes as study.json.
    """
    templates = Environment(
        loader=PackageLoader("gestured.lab.study", "report"), autoescape=select_autoescape(), trim_blocks=True
    )
    templates.filters["values"] = formats.values
    tables = EMPTY.sub("", templates.get_template("tables.md").render(study=study, reading=reading))
    drawn = {}
    with drawing.styled():
        for title, (part, draw) in FIGURES.items():
            if study[part]:
                drawn[title] = base64.b64encode(drawing.svg(draw(study), title).encode()).decode()
    parts = [table.groupdict() | {"rows": _cells(table["lines"])} for table in TABLE.finditer(tables)]
    path = out / "index.html"
    path.write_text(
        templates.get_template("page.html").render(about=study["about"], figures=drawn, tables=parts), "utf-8"
    )
    (out / "tables.md").write_text(tables, "utf-8")
    return path


def _cells(lines: str) -> list[list[str]]:
    """The cells of a Markdown table, the heading first."""
    head, _, *rows = lines.splitlines()
    return [[cell.strip() for cell in line.strip("|").split(" |")] for line in (head, *rows)]
