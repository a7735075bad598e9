"""operating-points.svg: error against run time in three fields, and error against when it is said."""

import json
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.lines import Line2D

from . import formats, reading
from .charts_run_time import Name, error_against_run_time, in_per_cent, place
from .drawing import INK, SOFT, Drawing, Mark, families, mark_of, styled
from .reading import Row, Study

FIELDS = {"simulated": "simulated people", "foreign": "another generator's people", "real": "real fingers"}
LEAST = 0.001  # an error of 0 is drawn here: a logarithm cannot show it
KINDS = {"provisional": 1, "final": 0}  # kinds of answer, and the filling of their marks
GROUP_MARKS = {"taps": Mark(0, "f0"), "swipes": Mark(1, "f1"), "circles": Mark(2, "f2"), "two fingers": Mark(3, "f3")}
WIDTH, HEIGHT = 1060, 860  # pixels


def write_picture(study: Study, out: Path) -> Path:
    """Write out/operating-points.json, what the picture is drawn from, and out/operating-points.svg; its path."""
    kept, path = points(study), out / "operating-points.svg"
    (out / "operating-points.json").write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    with styled():
        path.write_text(operating_points(kept), encoding="utf-8")
    return path


def points(study: Study) -> Study:
    """What the picture is drawn from, and where it comes from: the part of a study that is kept beside it."""
    about = {name: study["about"].get(name) for name in ("command", "version", "seed", "models", "quick")}
    methods = study.get("methods") or {}
    timed = {row["method"] for row in reading.part(study, "run_time")}
    named = {name: of for name, of in methods.items() if name in timed}
    return {
        "about": about,
        "machine": study["machine"],
        "methods": {name: {"title": of["title"], "family": of["family"]} for name, of in named.items()},
        "run_time": study["run_time"],
        "said": study.get("said") or [],
        **{name: [_false(row) for row in study.get(name) or []] for name in ("online", "online_shipped")},
    }


def _false(row: Row) -> Row:
    return {name: row[name] for name in ("method", "false_per_minute")}


def operating_points(study: Study) -> str:
    """The picture as a file of its own."""
    rows = [row for row in reading.part(study, "run_time") if row["precision"] != "int8"]  # as right, and as fast
    said = study.get("said") or []
    drawing = Drawing(WIDTH, HEIGHT if said else HEIGHT * 0.6)
    fields = [field for field in FIELDS if any(field in row.get("fields", {}) for row in rows)]
    upper: FigureBase = drawing.figure
    lower: FigureBase | None = None
    if said:
        parts: Any = drawing.figure.subfigures(2, 1, height_ratios=(3, 2))
        upper, lower = parts
    panels = upper.subplots(1, len(fields), sharex=True, sharey=True, squeeze=False)[0]
    names = []
    for axes, field in zip(panels, fields, strict=True):
        axes.set_title(f"A  {FIELDS[field]}: error, per cent", color=INK, fontweight="bold")
        shown = [row for row in rows if field in row.get("fields", {})]
        names.append(_run_time(study, drawing, axes, shown, field))
    panels[len(panels) // 2].set_xlabel(
        "run time of a decision on one core: the mark cold, as in a daemon at 15 Hz; the thin end warm"
    )
    _legend(study, upper, rows)
    if lower is not None:
        _said(drawing, lower.subplots(), said)
    for axes, some in zip(panels, names, strict=True):
        place(drawing, axes, some)
    return drawing.alone("Error against run time, and error against when it is said")


def _run_time(study: Study, drawing: Drawing, axes: Axes, rows: list[Row], field: str) -> list[Name]:
    """Draw one field; returns the names of its points, for `place`."""
    names: list[Name] = []
    error_against_run_time(axes)
    for row in rows:
        of, ships = row["fields"][field], row["settings"] == "shipped"
        mark = mark_of(study, row["method"])._replace(filling=3 if ships else int(row["precision"] == "int8"))
        error, wrong = max(LEAST, of["error"]), max(LEAST, of["wrong"])
        low, high = max(LEAST, of.get("error_low", error)), max(LEAST, of.get("error_high", error))
        cold, warm = row["cold_us"], row["median_us"]
        axes.plot([warm, cold], [error, error], color=mark.hue, linewidth=1.4, alpha=0.5)
        axes.plot([cold, cold], [low, high], color=mark.hue, linewidth=1.4, alpha=0.5)
        if wrong < error:
            axes.plot([cold, cold], [wrong, error], color=INK, linewidth=1, linestyle=(0, (1, 2)))
            axes.plot([cold], [wrong], marker="_", color=INK, markersize=9, linestyle="")
        words = (
            f"{reading.title(study, row['method'])} ({row['settings']}, {row['precision']}), {FIELDS[field]}: "
            f"{formats.with_unit(of['wrong'])} wrong, {formats.with_unit(of['error'])} wrong or lost; "
            f"{formats.duration(cold)} cold, {formats.duration(warm)} warm"
        )
        drawing.point(axes, cold, error, mark, words)
        names.append((ships, cold, error, reading.title(study, row["method"]) + (", ships" if ships else "")))
    return names


def _legend(study: Study, figure: FigureBase, rows: list[Row]) -> None:
    """Which mark is which family, and the marks' parts."""
    marks = families(study, rows)
    lines = [Line2D([], [], **mark.style | {"linestyle": ""}) for mark, _ in marks]
    lines += [Line2D([], [], linestyle="", marker="_", color=INK, markersize=9)]
    words = [*(words for _, words in marks), "wrong alone, the rest is lost"]
    figure.legend(lines, words, loc="outside lower center", ncols=3, frameon=False)


def _said(drawing: Drawing, axes: Axes, said: list[Row]) -> None:
    axes.set_title("B  the model that ships: error of what it says, per cent", color=INK, fontweight="bold")
    axes.semilogy()
    axes.minorticks_off()
    axes.grid(axis="x")
    axes.axvline(0.0, color=SOFT, linewidth=1)
    axes.set_xlabel("seconds after the last touched frame: median, and a line from the first to the last tenth")
    in_per_cent(axes)
    for row in said:
        mark = GROUP_MARKS[row["group"]]._replace(filling=KINDS[row["kind"]])
        wrong, low, high = (max(LEAST, row[name]) for name in ("wrong", "low", "high"))
        axes.plot([row["p10_s"], row["p90_s"]], [wrong] * 2, color=mark.hue, linewidth=1.4, alpha=0.5)
        axes.plot([row["p50_s"]] * 2, [low, high], color=mark.hue, linewidth=1.4, alpha=0.5)
        words = (
            f"{row['group']}, {row['kind']}: {formats.with_unit(row['wrong'])} of {row['n']} wrong, "
            f"{row['p50_s']:+.2f} s after the last touched frame"
        )
        drawing.point(axes, row["p50_s"], wrong, mark, words)
    groups = [group for group in GROUP_MARKS if any(row["group"] == group for row in said)]
    kinds = [kind for kind in KINDS if any(row["kind"] == kind for row in said)]
    marks = {f"{group}, {kind}": GROUP_MARKS[group]._replace(filling=KINDS[kind]) for kind in kinds for group in groups}
    lines = [Line2D([], [], **mark.style | {"linestyle": ""}) for mark in marks.values()]
    axes.set_ylim(top=8.0)  # room for the legend
    axes.legend(lines, list(marks), loc="upper center", ncols=4, frameon=False)
