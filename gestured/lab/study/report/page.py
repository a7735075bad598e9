"""The page: study.json in the template page.html, with the charts that matplotlib draws."""

import re
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, Undefined, select_autoescape

from gestured.simulator import GESTURES

from . import charts_course, charts_right, charts_run_time, drawing, formats, reading, summary
from .reading import Study

NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # what no XML may hold


class Missing(Undefined):
    """What a study lacks is null, in the template as in study.json."""

    def __new__(cls, *args: object, **names: object) -> None:  # type: ignore[misc]
        """None in place of an object of this class."""
        return None


def write_report(study: Study, out: Path) -> Path:
    """Write out/index.html, which needs nothing else and no network, and out/tables.md. Returns the page's path.

    `study` is what `gestured-lab study` writes as study.json. Parts that are null, empty or absent are left out
    with a sentence.
    """
    out.mkdir(parents=True, exist_ok=True)
    path = out / "index.html"
    with drawing.styled():
        path.write_text(_written(study, "page.html"), encoding="utf-8")
    (out / "tables.md").write_text(_written(study, "tables.md"), encoding="utf-8")
    return path


def _written(study: Study, template: str) -> str:
    return _environment().get_template(template).render(study=_writable(study))


@cache
def _environment() -> Environment:
    env = Environment(
        loader=PackageLoader("gestured.lab.study", "report"), autoescape=select_autoescape(), undefined=Missing,
        finalize=lambda value: "" if value is None else value, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True,
    )  # fmt: skip
    written = (
        formats.count, formats.duration, formats.interval, formats.number, formats.percent, formats.plain,
        formats.points, formats.with_unit,
    )  # fmt: skip
    env.filters.update({write.__name__: write for write in written})
    env.globals.update(
        course=charts_course, families=drawing.families, GESTURES=GESTURES, mark_of=drawing.mark_of, reading=reading,
        right=charts_right, timed=charts_run_time, summary=summary,
    )  # fmt: skip
    return env


def _writable(value: Any) -> Any:
    """The same with a sign of its own for what no XML may hold."""
    if isinstance(value, dict):
        return {name: _writable(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_writable(inner) for inner in value]
    return NO_XML.sub("\ufffd", value) if isinstance(value, str) else value
