"""Error against run time, and against the part of a gesture that has been seen."""

from . import formats, marks, reading
from .chart import LETTER, Plot, Point, Scale, polyline, spread, text
from .layout import SIMULATED, figure
from .markup import Markup, tag
from .reading import Row, Study

Box = tuple[float, float, float, float]  # left, top, right, bottom
AFTER = 1.6  # how long, on the axis of shares, one third of a second after the end is
WIDTH, HEIGHT = 960.0, 520.0


def run_time(study: Study) -> Markup:
    """1 - right against the median run time of one gesture, with the Pareto front."""
    rows = reading.part(study, "run_time")
    fast, slow = min(row["median_us"] for row in rows), max(row.get("p95_us") or row["median_us"] for row in rows)
    worst = max(1 - row["right"] for row in rows)
    x = Scale(fast / 1.6, slow * 1.6, 56, WIDTH - 24, log=True)
    plot = Plot(WIDTH, HEIGHT, x, Scale(0.0, min(1.0, worst * 1.12), HEIGHT - 56, 36))
    plot.y_axis(plot.y.ticks(), lambda share: formats.percent(share, 0), "error: gestures that are not right, per cent")
    plot.x_axis(
        x.ticks(),
        formats.duration,
        "run time of one gesture on one core: median, and a line to the 95th percentile",
        True,
    )
    _front(plot, [row for row in rows if row.get("front")])
    places = [(plot.x(row["median_us"]), plot.y(1 - row["right"])) for row in rows]
    for row, (px, py) in zip(rows, places, strict=True):
        look = marks.look_of(study, row["method"])
        plot.add(marks.whisker(px, py, plot.x(row.get("p95_us") or row["median_us"]), py, look.classes + " faint"))
    for row, (px, py) in zip(rows, places, strict=True):
        look = marks.look_of(study, row["method"])
        plot.add(marks.marker(marks.Look(look.family, int(row["precision"] == "int8")), px, py, _told(study, row)))
    _names(plot, [_name(study, row, rows) for row in rows], places, [bool(row.get("front")) for row in rows])
    legend = marks.family_key(study, [row["method"] for row in rows])
    return figure(
        "Error against run time",
        SIMULATED,
        "Lower and further left is better. The line is the Pareto front: nothing is both faster and more often right. "
        "Hollow marks are int8. Features and preparation are included, on one core, warmed up, in interleaved order.",
        legend,
        plot.svg("Error against run time, simulated data", "; ".join(_told(study, row) for row in rows)),
    )


def _told(study: Study, row: Row) -> str:
    wrong, time = formats.with_unit(1 - row["right"]), formats.duration(row["median_us"])
    return f"{reading.title(study, row['method'])} ({row['settings']}, {row['precision']}): {wrong} wrong in {time}"


def _name(study: Study, row: Row, rows: list[Row]) -> str:
    """The method's title, and what tells it from its other points."""
    same = [other for other in rows if other["method"] == row["method"]]
    more = ["tuned"] if row["settings"] == "tuned" and any(other["settings"] != "tuned" for other in same) else []
    more += ["int8"] if row["precision"] == "int8" else []
    return ", ".join([reading.title(study, row["method"]), *more])


def _front(plot: Plot, rows: list[Row]) -> None:
    """A staircase through the points that nothing beats."""
    points = sorted((row["median_us"], 1 - row["right"]) for row in rows)
    if not points:
        return
    stairs: list[Point] = [(points[0][0], plot.y.high)]
    for time, error in points:
        stairs += [(time, stairs[-1][1]), (time, error)]
    stairs.append((plot.x.high, stairs[-1][1]))
    plot.add(polyline(plot.at(stairs), "front"))


def _names(plot: Plot, names: list[str], places: list[Point], front: list[bool]) -> None:
    """Names beside their points: the nearest free place around each; those on the front choose first."""
    taken: list[Box] = [(x - 7, y - 7, x + 7, y + 7) for x, y in places]
    order = sorted(range(len(names)), key=lambda k: (not front[k], places[k][1]))
    for k in order:
        width, (x, y) = LETTER * len(names[k]), places[k]
        for away in (0.0, 14.0, 28.0, 44.0, 62.0, 84.0):
            free = next((box for box in _around(x, y, width, away) if _fits(box, taken, plot)), None)
            if free is not None:
                taken.append(free)
                middle = (free[1] + free[3]) / 2
                if away:  # far enough that a line must say whose name it is
                    end = free[0] if free[0] > x else free[2] if free[2] < x else x
                    edge = middle if end != x else (free[1] if free[1] > y else free[3])
                    plot.add(tag("line", x1=x, y1=y, x2=end, y2=edge, class_="leader"))
                plot.add(text(free[0] + 1, middle + 4, names[k], class_="name front-name" if front[k] else "name"))
                break


def _around(x: float, y: float, width: float, away: float) -> list[Box]:
    """Boxes for a name about a point: right, left, above, below, and askew."""
    gap, half = 9 + away * 0.6, 7.5
    corners = [
        (x + gap, y - half),
        (x - gap - width, y - half),
        (x - width / 2, y - gap - 2 * half),
        (x - width / 2, y + gap),
    ]
    for lift in (-away - half, away + half) if away else (-12.0, 12.0):
        corners += [(x + gap * 0.8, y - half + lift), (x - gap * 0.8 - width, y - half + lift)]
    return [(left, top, left + width, top + 2 * half) for left, top in corners]


def _fits(box: Box, taken: list[Box], plot: Plot) -> bool:
    left, top, right, bottom = box
    inside = plot.x.start <= left and right <= plot.x.end + 16 and plot.y.end - 6 <= top and bottom <= plot.y.start
    return inside and all(right <= a or c <= left or bottom <= b or d <= top for a, b, c, d in taken)


def elapsed(study: Study) -> Markup:
    """Error after a part of the gesture, and after its end."""
    rows = reading.part(study, "elapsed")
    latest = max((at["after_s"] for row in rows for at in row["at"] if "after_s" in at), default=0.0)
    end = 1.0 + AFTER * latest
    worst = max(1 - low for row in rows for low in row["low"])
    plot = Plot(WIDTH, 400, Scale(0.2, max(end, 1.02), 56, WIDTH - 190), Scale(0.0, min(1.0, worst * 1.05), 336, 36))
    plot.y_axis(plot.y.ticks(), lambda share: formats.percent(share, 0), "error, per cent")
    ticks = sorted({_place(at) for row in rows for at in row["at"]})
    plot.x_axis(ticks, _moment, "part of the gesture that has been seen, then time after its end")
    if latest:
        plot.add(tag("rect", x=plot.x(1.0), y=36, width=plot.x.end - plot.x(1.0), height=300, class_="after"))
        plot.add(text(plot.x(1.0) + 8, 52, "after the end", class_="tick"))
    curves(study, plot, [(row["method"], [_place(at) for at in row["at"]], row) for row in rows], error=True)
    return figure(
        "Error against elapsed gesture time",
        SIMULATED,
        "What the recurrent nets say before the gesture has ended, and just after. Bands are 95 % intervals.",
        marks.key(study, [row["method"] for row in rows]),
        plot.svg("Error against elapsed gesture time, simulated data", "One falling curve for each recurrent net."),
    )


def _place(at: dict[str, float]) -> float:
    return at["share"] if "share" in at else 1.0 + AFTER * at["after_s"]


def _moment(place: float) -> str:
    return f"{100 * place:.0f} %" if place <= 1.0 else f"+{1000 * (place - 1.0) / AFTER:.0f} ms"


def curves(study: Study, plot: Plot, series: list[tuple[str, list[float], Row]], error: bool = False) -> None:
    """Lines with their bands and marks, and each method's name at the end of its line."""
    for method, x, row in series:
        ordered = sorted(zip(x, row["right"], row["low"], row["high"], strict=True), key=lambda point: point[0])
        at, right, low, high = (list(column) for column in zip(*ordered, strict=True))
        if error:
            right, low, high = ([1 - v for v in right], [1 - v for v in high], [1 - v for v in low])
        look = marks.look_of(study, method)
        plot.band(at, [max(plot.y.low, v) for v in low], [min(plot.y.high, v) for v in high], f"band {look.classes}")
        plot.line(list(zip(at, right, strict=True)), f"curve {look.classes}")
        for place, share in zip(at, right, strict=True):
            words = f"{reading.title(study, method)}: {formats.with_unit(share)}"
            plot.add(marks.marker(look, plot.x(place), plot.y(share), words, "small"))
    ends = [plot.y(1 - row["right"][-1] if error else row["right"][-1]) for _, _, row in series]
    top, bottom = sorted((plot.y.start, plot.y.end))
    for (method, _, _), end, place in zip(series, ends, spread(ends, 17, top, bottom), strict=True):
        right_edge = plot.x.end
        plot.add(tag("line", x1=right_edge + 6, y1=end, x2=right_edge + 18, y2=place, class_="leader"))
        plot.add(text(right_edge + 22, place + 4, reading.title(study, method), class_="name"))
