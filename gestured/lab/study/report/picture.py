"""operating-points.svg: error against run time in three fields."""

import json
from itertools import product
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator

from . import formats, reading
from .drawing import INK, SOFT, families, mark_of, sheet, styled, svg
from .reading import Row, Study

FIELDS = {"simulated": "simulated people", "foreign": "another generator's people", "real": "real fingers"}
LEAST = 0.001  # an error of 0 is drawn here: a logarithm cannot show it
WIDTH, HEIGHT = 1060, 516  # pixels
REACH = (0, 10, 20, 32, 46, 62, 80, 100)  # pixels that a name may be moved away from its point
TITLE = "Error against run time"
Name = tuple[bool, float, float, str]  # whether it is bold and chooses first, x, y, the words


def write_picture(study: Study, out: Path) -> Path:
    """Write out/operating-points.json, what the picture is drawn from, and out/operating-points.svg; its path."""
    kept, path = points(study), out / "operating-points.svg"
    (out / "operating-points.json").write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    with styled():
        path.write_text(svg(operating_points(kept), TITLE), encoding="utf-8")
    return path


def points(study: Study) -> Study:
    """What the picture is drawn from, and where it comes from: the part of a study that is kept beside it."""
    about = {name: study["about"].get(name) for name in ("command", "version", "seed", "models", "quick")}
    timed = {row["method"] for row in study["run_time"]}
    named = {name: of for name, of in study["methods"].items() if name in timed}
    return {
        "about": about,
        "machine": study["machine"],
        "methods": {name: {"title": of["title"], "family": of["family"]} for name, of in named.items()},
        "run_time": study["run_time"],
        **{name: [_false(row) for row in study[name]] for name in ("online", "online_shipped")},
    }


def _false(row: Row) -> Row:
    return {name: row[name] for name in ("method", "false_per_minute")}


def operating_points(study: Study) -> Figure:
    """The picture, of what `points` keeps."""
    rows = study["run_time"]
    figure = sheet(WIDTH, HEIGHT)
    fields = [field for field in FIELDS if any(field in row["fields"] for row in rows)]
    panels = figure.subplots(1, len(fields), sharex=True, sharey=True, squeeze=False)[0]
    names = []
    for axes, field in zip(panels, fields, strict=True):
        axes.set_title(f"{FIELDS[field]}: error, per cent", color=INK, fontweight="bold")
        names.append(_run_time(study, axes, [row for row in rows if field in row["fields"]], field))
    label = "run time of a decision on one core: the mark cold, as in a daemon at 15 Hz; the thin end warm"
    panels[len(panels) // 2].set_xlabel(label)
    _legend(study, figure, rows)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes, some in zip(panels, names, strict=True):
        _place(axes, some)
    return figure


def _run_time(study: Study, axes: Axes, rows: list[Row], field: str) -> list[Name]:
    """Draw one field; returns the names of its points, for `_place`."""
    names: list[Name] = []
    axes.loglog()
    axes.minorticks_off()
    axes.grid(axis="x")
    _in_per_cent(axes)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda time, _: formats.duration(time)))
    for row in rows:
        of, ships = row["fields"][field], row["settings"] == "shipped"
        mark = mark_of(study, row["method"])._replace(filling=3 if ships else 0)
        error, wrong = max(LEAST, of["error"]), max(LEAST, of["wrong"])
        low, high = max(LEAST, of.get("error_low", error)), max(LEAST, of.get("error_high", error))
        cold, warm = row["cold_us"], row["median_us"]
        axes.plot([warm, cold], [error, error], color=mark.hue, linewidth=1.4, alpha=0.5)
        axes.plot([cold, cold], [low, high], color=mark.hue, linewidth=1.4, alpha=0.5)
        if wrong < error:
            axes.plot([cold, cold], [wrong, error], color=INK, linewidth=1, linestyle=(0, (1, 2)))
            axes.plot([cold], [wrong], marker="_", color=INK, markersize=9, linestyle="")
        mark.point(axes, cold, error)
        names.append((ships, cold, error, reading.title(study, row["method"]) + (", ships" if ships else "")))
    return names


def _in_per_cent(axes: Axes) -> None:
    """Write shares on a logarithmic axis as per cent."""
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g}" if share <= 1 else ""))


def _place(axes: Axes, names: list[Name]) -> None:
    """Write each name into the nearest free place around its point; a name that was moved far gets a line to it.

    Bold names choose first. One that finds no place is left out: the table has it.
    """
    taken = [line.get_window_extent().padded(2) for line in axes.lines]
    for first, x, y, words in sorted(names, key=lambda name: (not name[0], name)):
        for reach, dx, dy in product(REACH, (1, -1, 0), (0, 1, -1)):
            offset = dx * (9 + 0.4 * reach), dy * (reach + (7 if dx else 16))
            text = axes.annotate(
                words, (x, y), offset, textcoords="offset points", ha={1: "left", -1: "right", 0: "center"}[dx],
                va="center", fontweight="bold" if first else "normal",
            )  # fmt: skip
            box = text.get_window_extent()
            if all(axes.bbox.contains(*corner) for corner in box.corners()) and not box.count_overlaps(taken):
                taken.append(box)
                if reach:
                    line = {"arrowstyle": "-", "color": SOFT, "linewidth": 0.8, "shrinkA": 0}
                    axes.annotate("", (x, y), offset, textcoords="offset points", arrowprops=line)
                break
            text.remove()


def _legend(study: Study, figure: Figure, rows: list[Row]) -> None:
    """Which mark is which family, and the marks' parts."""
    marks = families(study, rows)
    lines = [Line2D([], [], **mark.style) for mark, _ in marks]
    lines += [Line2D([], [], linestyle="", marker="_", color=INK, markersize=9)]
    words = [*(words for _, words in marks), "wrong alone, the rest is lost"]
    figure.legend(lines, words, loc="outside lower center", ncols=3, frameon=False)
