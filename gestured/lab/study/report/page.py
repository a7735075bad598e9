"""The page and tables.md: a study's figures and tables, in one file each."""

import base64
from pathlib import Path

from jinja2 import Environment, PackageLoader

from gestured.lab.made_of import SHOWN

from . import drawing, figures, picture
from .reading import Study
from .tables import tables

FIGURES = {  # title -> the part of the study that it needs, and how it is drawn
    "The published figures and ours": ("cells", figures.overview),
    picture.TITLE: ("run_time", lambda study: picture.operating_points(picture.points(study))),
    "Which gesture is taken for which": ("cells", figures.confusion),
    "How sure the methods are": ("calibration", figures.calibration),
}


def write_report(study: Study, out: Path) -> Path:
    """Write out/index.html, which needs nothing else and no network, and out/tables.md. Returns the page's path.

    `study` is what `gestured-lab study` writes as study.json.
    """
    found, drawn = tables(study), {}
    with drawing.styled():
        for title, (part, draw) in FIGURES.items():
            if study[part]:
                drawn[title] = base64.b64encode(drawing.svg(draw(study), title).encode()).decode()
    page = Environment(loader=PackageLoader("gestured.lab.study", "report"), autoescape=True, trim_blocks=True)
    path = out / "index.html"
    path.write_text(page.get_template("page.html").render(about=study["about"], figures=drawn, tables=found), "utf-8")
    (out / "tables.md").write_text("\n".join([_origin(study), "", *map(str, found)]), "utf-8")
    return path


def _origin(study: Study) -> str:
    """Of which models the tables speak, and where they were made."""
    about, machine, data = study["about"], study["machine"], study["data"]["simulated"]
    models = ", ".join(f"{name}.onnx {digest[:SHOWN]}" for name, digest in about["models"].items())
    return (
        f"<!-- made by `{about['command']}` of {models} -->\n"
        f"`gestured-lab study` on {machine['date']}, {machine['cpu']}, {machine['cores']} cores, "
        f"{machine['minutes']} minutes. Simulated: {data['name']}, {data['participants']} participants, "
        f"{data['performed']} gestures performed, {data['cut']} cut out by the front end."
    )
