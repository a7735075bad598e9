"""The study's pictures: error against run time in three fields, and which gesture is taken for which."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator

from gestured.core.timing import Timing
from gestured.lab.drawing import INK, SOFT, sheet, styled, svg
from gestured.lab.samples import WINDOW
from gestured.lab.written import write

Study = dict[str, Any]
Row = dict[str, Any]
FIELDS = {"simulated": "simulated people", "foreign": "another generator", "real": "real fingers"}
LEAST = 0.001  # an error of 0 is drawn here: a logarithm cannot show it
WIDTH, HEIGHT = 1060, 430  # pixels
TITLE = "Error against the time from the last touched frame to the answer"
FRAME_MS = 1000 / WINDOW.rate_hz
WAIT_MS = FRAME_MS + 1000 * Timing().release_s  # a contact is over after `release_s` of quiet, which a frame must show
Name = tuple[float, float, bool, str]  # error, time, whether the model ships, words
LINE = 15  # pixels of a name
RAISED = 8  # pixels by which a name stands above its point: the line of the best models runs through the point
NAMED = 2  # best methods of a field that are named beside those that ship
SHORT = {" features, ": " ", "k nearest neighbours": "KNN", "support vector machine": "SVM", " (RBF)": ""}
CONFUSION = "Which gesture is taken for which"
ACROSS = 4  # matrices beside each other


def title(study: Study, method: str) -> str:
    """A method's name, as short as it is clear."""
    name = str(study["methods"][method]["title"])
    for words, fewer in SHORT.items():
        name = name.replace(words, fewer)
    return name


def write_picture(study: Study, out: Path) -> Path:
    """Write out/operating-points.json, what the picture is drawn from, and out/operating-points.svg; its path."""
    kept, path = points(study), out / "operating-points.svg"
    write(out / "operating-points.json", json.dumps(kept, indent=1) + "\n")
    with styled():
        write(path, svg(operating_points(kept), TITLE))
    return path


def points(study: Study) -> Study:
    """The part of a study that the picture is drawn from and that is kept beside it, with its origin."""
    timed = {row["method"] for row in study["run_time"]}
    return {
        "about": {name: study["about"][name] for name in ("command", "version", "seed", "models", "quick")},
        "machine": study["machine"],
        "methods": {name: {"title": of["title"]} for name, of in study["methods"].items() if name in timed},
        "run_time": study["run_time"],
        **{
            name: [{key: row[key] for key in ("method", "false_per_minute")} for row in study[name]]
            for name in ("online", "online_shipped")
        },
    }


def operating_points(study: Study) -> Figure:
    """The picture, of what `points` keeps: a panel for each field, and one axis of errors for all."""
    rows = study["run_time"]
    figure = sheet(WIDTH, HEIGHT)
    fields = [field for field in FIELDS if any(field in row["fields"] for row in rows)]
    panels = figure.subplots(1, len(fields), sharex=True, sharey=True, squeeze=False)[0]
    names = []
    for axes, field in zip(panels, fields, strict=True):
        axes.set_title(FIELDS[field], color=INK, fontweight="bold")
        names.append(_field(study, axes, [row for row in rows if field in row["fields"]], field))
    panels[0].set_ylabel("wrong or lost, per cent")
    panels[len(panels) // 2].set_xlabel(
        f"ms from a gesture's last touched frame to its answer; a frame lasts {FRAME_MS:.0f} ms"
    )
    of = {name: [row["false_per_minute"] * 60 for row in study[name]] for name in ("online_shipped", "online")}
    words = [f"{what}: {_range(of[name])} false an hour in sessions" for name, what in
             (("online_shipped", "ships"), ("online", "the study's, reject nothing")) if of[name]]  # fmt: skip
    parts = [Line2D([], [], marker="o", linestyle="", color=colour, markersize=9) for colour in (INK, SOFT)]
    parts = [*parts[: len(words)], Line2D([], [], color=SOFT, linewidth=1.4)]
    words.append("no model is both earlier and better")
    figure.legend(parts, words, loc="outside lower center", ncols=3, frameon=False)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes, some in zip(panels, names, strict=True):
        _name(axes, some)
    return figure


def _range(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.0f}" if round(low) == round(high) else f"{low:.0f} to {high:.0f}"


def _field(study: Study, axes: Axes, rows: list[Row], field: str) -> list[Name]:
    """Draw one field: a point for each model, and the line of those that no other beats; returns names to write."""
    axes.set_yscale("log")
    axes.minorticks_off()
    axes.set_xlim(WAIT_MS - 4, WAIT_MS + FRAME_MS)
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g}" if share <= 1 else ""))
    found = sorted(_point(study, row, field) for row in rows)
    front: list[tuple[float, float]] = []
    for time, error, *_ in found:
        if not front or error < front[-1][1]:
            front.append((time, error))
    axes.step(*zip(*[*front, (WAIT_MS + FRAME_MS, front[-1][1])], strict=True), where="post", color=SOFT, linewidth=1.4)
    best = sorted(error for _, error, ships, _ in found if not ships)[:NAMED]
    names: list[Name] = []
    for time, error, ships, name in found:
        look = (INK, 9, 4) if ships else (SOFT, 6, 3)
        axes.plot([time], [error], "o", color=look[0], markersize=look[1], clip_on=False, zorder=look[2])
        if ships or error in best:
            names.append((error, time, ships, f"{name}, ships" if ships else name))
    return names


def _point(study: Study, row: Row, field: str) -> tuple[float, float, bool, str]:
    """When a model answers (ms), how often it is wrong or loses a gesture, whether it ships, and its name."""
    error = max(LEAST, row["fields"][field]["error"])
    return WAIT_MS + row["cold_us"] / 1000, error, row["settings"] == "shipped", title(study, row["method"])


def _name(axes: Axes, names: list[Name]) -> None:
    """Write names beside their points, the lowest first, none over another."""
    free = -math.inf  # pixels from which on no name stands
    for error, time, ships, words in sorted(names):
        at = float(axes.transData.transform((time, error))[1])
        up = max(at + RAISED, free) - at
        free = at + up + LINE
        arrow = {"arrowstyle": "-", "color": SOFT, "linewidth": 0.6, "shrinkB": 5}
        axes.annotate(
            words, (time, error), (16, up), textcoords="offset points", va="center",
            fontweight="bold" if ships else "normal", arrowprops=arrow if up > RAISED else None,
        )  # fmt: skip


def confusion(study: Study) -> Figure:
    """For each method, which gesture (row) is taken for which (column), in per cent of the row.

    The cells are those of people never seen, tuned, with shifted copies.
    """
    wanted = {"protocol": "participants", "settings": "tuned", "augmentation": "shift", "data": "simulated"}
    rows = [row for row in study["cells"] if all(row[name] == value for name, value in wanted.items())]
    names = [name.replace("_", " ") for name in study["about"]["gestures"]]
    down = -(-len(rows) // ACROSS)
    figure = sheet(180 + 250 * min(ACROSS, len(rows)), 150 + 280 * down)
    panels = figure.subplots(down, min(ACROSS, len(rows)), sharey=True, squeeze=False).ravel()
    for axes in panels[len(rows) :]:
        axes.set_visible(False)
    for k, (axes, row) in enumerate(zip(panels, rows, strict=False)):
        counts = np.array(row["confusion"], float)
        shares = 100 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        axes.imshow(shares, cmap="Blues", vmin=0, vmax=140)  # light enough for the numbers to be read
        axes.set_title(title(study, row["method"]), color=INK)
        axes.grid(visible=False)
        below = names if k + ACROSS >= len(rows) else [""] * len(names)
        axes.set_xticks(range(len(names)), below, rotation=90)
        axes.set_yticks(range(len(names)), names)
        for i, j in np.argwhere(shares):
            axes.text(j, i, f"{shares[i, j]:.0f}", ha="center", va="center", fontsize=8)
    return figure
