"""The chart of error against run time, and names that find a place beside their points."""

from itertools import pairwise, product

from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator

from . import formats, reading
from .drawing import INK, SOFT, Drawing, mark_of
from .reading import Row, Study

Name = tuple[bool, float, float, str]  # whether it is bold and chooses first, x, y, the words
REACH = (0, 10, 20, 32, 46, 62, 80, 100)  # pixels that a name may be moved away from its point


def run_time(study: Study) -> Markup:
    """1 - right against the median run time of one gesture, both axes logarithmic, with the Pareto front."""
    rows = reading.part(study, "run_time")
    drawing = Drawing(960, 540)
    axes = drawing.figure.subplots()
    errors = [_error(row) for row in rows]
    error_against_run_time(axes)
    axes.set_xlim(min(row["median_us"] for row in rows) / 1.5, 1.8 * max(map(_p95, rows)))
    axes.set_ylim(min(errors) / 1.5, min(1.0, 1.3 * max(errors)))
    label = "run time of one gesture on one core: median, and a line to the 95th percentile"
    axes.set(title="error, per cent", xlabel=label)
    names = []
    for row, error in zip(rows, errors, strict=True):
        mark, time = mark_of(study, row["method"]), row["median_us"]
        axes.plot([time, _p95(row)], [error, error], color=mark.hue, linewidth=1.8, alpha=0.45)
        drawing.point(
            axes,
            time,
            error,
            mark._replace(filling=3 if row["settings"] == "shipped" else int(row["precision"] == "int8")),
            told(study, row),
        )
        names.append((bool(row.get("front")), time, error, _name(study, row, rows)))
    front = sorted((time, error) for first, time, error, _ in names if first)
    if front:
        stairs = [(front[0][0], axes.get_ylim()[1]), *front, (axes.get_xlim()[1], front[-1][1])]
        for (x, y), (u, v) in pairwise(stairs):  # each tread and riser by itself, so that names find a place between
            for ends in (([x, u], [y, y]), ([u, u], [y, v])):
                axes.plot(*ends, color=INK, linewidth=1.4, linestyle=(0, (1, 3)))
    place(drawing, axes, names)
    return drawing.svg("Error against run time, simulated data", "; ".join(told(study, row) for row in rows))


def error_against_run_time(axes: Axes) -> None:
    """Make both axes logarithmic, of errors in per cent and of microseconds."""
    axes.loglog()
    axes.minorticks_off()
    axes.grid(axis="x")
    in_per_cent(axes)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda time, _: formats.duration(time)))


def in_per_cent(axes: Axes) -> None:
    """Write shares on a logarithmic axis as per cent."""
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g}" if share <= 1 else ""))


def place(drawing: Drawing, axes: Axes, names: list[Name]) -> None:
    """Write each name into the nearest free place around its point; those of the front are bold and choose first.

    A name that was moved far gets a line to its point; one that finds no place is left to the mark's own words.
    """
    drawing.figure.draw_without_rendering()
    drawing.figure.set_layout_engine("none")
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


def _error(row: Row) -> float:
    """1 - right; at least 1 in 1000, which a logarithm can show."""
    return max(0.001, 1 - float(row["right"]))


def _p95(row: Row) -> float:
    return float(row.get("p95_us") or row["median_us"])


def told(study: Study, row: Row) -> str:
    """What a point of error against run time says when the pointer rests on it."""
    wrong, time = formats.with_unit(1 - row["right"]), formats.duration(row["median_us"])
    return f"{reading.title(study, row['method'])} ({row['settings']}, {row['precision']}): {wrong} wrong in {time}"


def _name(study: Study, row: Row, rows: list[Row]) -> str:
    """The method's title, and what tells it from its other points."""
    same = [other for other in rows if other["method"] == row["method"]]
    more = ["tuned"] if row["settings"] == "tuned" and any(other["settings"] != "tuned" for other in same) else []
    more += ["ships"] if row["settings"] == "shipped" else []
    more += ["int8"] if row["precision"] == "int8" else []
    return ", ".join([reading.title(study, row["method"]), *more])
