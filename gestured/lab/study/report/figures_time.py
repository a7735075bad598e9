"""Error against run time, with the Pareto front."""

from . import formats, marks, reading
from .chart import Plot, Point, Scale, polyline
from .labels import Box, place_names
from .layout import SIMULATED, figure
from .markup import Markup
from .reading import Row, Study

WIDTH, HEIGHT = 960.0, 540.0


def run_time(study: Study) -> Markup:
    """1 - right against the median run time of one gesture; both axes logarithmic."""
    rows = reading.part(study, "run_time")
    fast, slow = min(row["median_us"] for row in rows), max(_p95(row) for row in rows)
    errors = [_error(row) for row in rows]
    x = Scale(fast / 1.5, slow * 1.8, 56, WIDTH - 24, log=True)
    y = Scale(min(errors) / 1.5, min(1.0, max(errors) * 1.3), HEIGHT - 56, 36, log=True)
    plot = Plot(WIDTH, HEIGHT, x, y)
    plot.y_axis(y.ticks(), lambda share: formats.percent(share, 0 if share >= 0.01 else 1), "error, per cent")
    label = "run time of one gesture on one core: median, and a line to the 95th percentile"
    plot.x_axis(x.ticks(), formats.duration, label, grid=True)
    front = _stairs(plot, [row for row in rows if row.get("front")])
    if front:
        plot.add(polyline(front, "front"))
    looks = [marks.look_of(study, row["method"]) for row in rows]
    places = [(plot.x(row["median_us"]), plot.y(_error(row))) for row in rows]
    for row, look, (px, py) in zip(rows, looks, places, strict=True):
        plot.add(marks.whisker(px, py, plot.x(_p95(row)), py, look.classes + " faint"))
    taken: list[Box] = [(px - 7, py - 7, px + 7, py + 7) for px, py in places]
    taken += [(px, py - 2, plot.x(_p95(row)), py + 2) for row, (px, py) in zip(rows, places, strict=True)]
    taken += [_along(one, other) for one, other in zip(front, front[1:], strict=False)]
    place_names(
        plot, [_name(study, row, rows) for row in rows], places, [bool(row.get("front")) for row in rows], taken
    )
    for row, look, (px, py) in zip(rows, looks, places, strict=True):
        same = marks.Look(look.family, int(row["precision"] == "int8"))
        plot.add(marks.marker(same, px, py, _told(study, row)))
    return figure(
        "Each method's error and run time",
        SIMULATED,
        "Lower and further left is better. The dotted line is the Pareto front, its methods in bold: nothing is both "
        "faster and more often right. Hollow marks are int8. Features and preparation are included; one core, warmed "
        "up, in interleaved order.",
        marks.family_key(study, [row["method"] for row in rows]),
        plot.svg("Error against run time, simulated data", "; ".join(_told(study, row) for row in rows)),
    )


def _error(row: Row) -> float:
    """1 - right; at least 1 in 1000, which a logarithm can show."""
    return max(0.001, 1 - float(row["right"]))


def _p95(row: Row) -> float:
    return float(row.get("p95_us") or row["median_us"])


def _told(study: Study, row: Row) -> str:
    wrong, time = formats.with_unit(1 - row["right"]), formats.duration(row["median_us"])
    return f"{reading.title(study, row['method'])} ({row['settings']}, {row['precision']}): {wrong} wrong in {time}"


def _name(study: Study, row: Row, rows: list[Row]) -> str:
    """The method's title, and what tells it from its other points."""
    same = [other for other in rows if other["method"] == row["method"]]
    more = ["tuned"] if row["settings"] == "tuned" and any(other["settings"] != "tuned" for other in same) else []
    more += ["int8"] if row["precision"] == "int8" else []
    return ", ".join([reading.title(study, row["method"]), *more])


def _stairs(plot: Plot, rows: list[Row]) -> list[Point]:
    """A staircase in pixels through the points that nothing beats, from the top to the right edge."""
    points = sorted((plot.x(row["median_us"]), plot.y(_error(row))) for row in rows)
    stairs: list[Point] = [(x, plot.y.end) for x, _ in points[:1]]
    for x, y in points:
        stairs += [(x, stairs[-1][1]), (x, y)]
    return [*stairs, (plot.x.end, stairs[-1][1])] if stairs else []


def _along(one: Point, other: Point) -> Box:
    """A box about a level or upright line."""
    (left, right), (top, bottom) = sorted((one[0], other[0])), sorted((one[1], other[1]))
    return left - 2, top - 2, right + 2, bottom + 2
