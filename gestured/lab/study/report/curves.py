"""Lines with their intervals: error against elapsed gesture time, and learning curves."""

from . import formats, marks, reading
from .chart import Plot, Scale, text
from .labels import spread
from .layout import SIMULATED, figure
from .markup import Markup, tag
from .reading import Row, Study

WIDTH, TOP, BOTTOM = 960.0, 36.0, 336.0
NAMES = 235.0  # pixels to the right of the lines, for the names at their ends
AFTER = 2.4  # the width of one second after the end, on the axis of shares


def elapsed(study: Study) -> Markup:
    """Error after a part of the gesture, and after its end."""
    rows = reading.part(study, "elapsed")
    series = [(row["method"], [_place(at) for at in row["at"]], _errors(row)) for row in rows]
    latest = max((at["after_s"] for row in rows for at in row["at"] if "after_s" in at), default=0.0)
    worst = max(error for _, _, errors in series for error in errors["high"])
    plot = Plot(
        WIDTH,
        400,
        Scale(0.2, 1.02 + AFTER * latest, 56, WIDTH - NAMES),
        Scale(0.0, min(1.0, worst * 1.05), BOTTOM, TOP),
    )
    if latest:
        start = plot.x(1.0)
        plot.add(tag("rect", x=start, y=TOP, width=plot.x.end - start, height=BOTTOM - TOP, class_="after"))
        plot.add(text(start + 8, TOP + 16, "after the end", class_="tick"))
    plot.y_axis(plot.y.ticks(), lambda share: formats.percent(share, 0), "error, per cent")
    ticks = sorted({round(place, 6) for _, places, _ in series for place in places})
    plot.x_axis(ticks, _moment, "part of the gesture that has been seen, then time after its end")
    _draw(study, plot, series)
    return figure(
        "Error against elapsed gesture time",
        SIMULATED,
        "What the nets answer before the gesture has ended, and just after. Bands are 95 % intervals.",
        marks.key(study, [row["method"] for row in rows]),
        plot.svg("Error against elapsed gesture time, simulated data", _ends(study, series, "wrong at the end")),
    )


def learning(study: Study) -> Markup:
    """How often new people's gestures are right, against the number of people learned from."""
    rows = reading.part(study, "learning")
    series = [(row["method"], [float(count) for count in row["participants"]], row) for row in rows]
    people = sorted({count for _, counts, _ in series for count in counts})
    lowest = min(min(reading.bounds(row)[0]) for row in rows)
    x = Scale(people[0] / 1.1, max(people[-1] * 1.05, people[0] * 2), 56, WIDTH - NAMES, log=True)
    plot = Plot(WIDTH, 400, x, Scale(reading.below(lowest), 1.0, BOTTOM, TOP))
    plot.y_axis(plot.y.ticks(), lambda share: formats.percent(share, 0), "right, per cent")
    plot.x_axis(people, lambda count: f"{count:.0f}", "participants in the training set")
    _draw(study, plot, series)
    return figure(
        "Learning curves",
        SIMULATED,
        "How often gestures of people never seen are right, against the number of people learned from.",
        marks.key(study, [row["method"] for row in rows]),
        plot.svg("Learning curves, simulated data", _ends(study, series, "right at the end")),
    )


def _errors(row: Row) -> Row:
    low, high = reading.bounds(row)
    return {"right": [1 - share for share in row["right"]], "low": [1 - v for v in high], "high": [1 - v for v in low]}


def _place(at: dict[str, float]) -> float:
    return float(at["share"]) if "share" in at else 1.0 + AFTER * at["after_s"]


def _moment(place: float) -> str:
    return f"{100 * place:.0f} %" if place <= 1.0 else f"+{1000 * (place - 1.0) / AFTER:.0f} ms"


def _ends(study: Study, series: list[tuple[str, list[float], Row]], words: str) -> str:
    return "; ".join(
        f"{reading.title(study, m)}: {formats.with_unit(row['right'][-1])} {words}" for m, _, row in series
    )


def _draw(study: Study, plot: Plot, series: list[tuple[str, list[float], Row]]) -> None:
    """Bands below, then lines with their marks, and each method's name at the end of its line."""
    ends = []
    for method, at, row in series:
        low, high = reading.bounds(row)
        inside = ([max(plot.y.low, v) for v in low], [min(plot.y.high, v) for v in high])
        plot.band(at, *inside, f"band {marks.look_of(study, method).classes}")
    for method, at, row in series:
        look, title = marks.look_of(study, method), reading.title(study, method)
        points = list(zip(at, row["right"], strict=True))
        plot.line(points, f"curve {look.classes}")
        for place, share in points:
            words = f"{title}: {formats.with_unit(share)}"
            plot.add(marks.marker(look, plot.x(place), plot.y(share), words, "small"))
        ends.append((plot.x(at[-1]), plot.y(row["right"][-1]), title))
    places = spread([y for _, y, _ in ends], 17, TOP, BOTTOM)
    for (x, y, title), place in zip(ends, places, strict=True):
        plot.add(tag("line", x1=x + 9, y1=y, x2=plot.x.end + 20, y2=place, class_="leader"))
        plot.add(text(plot.x.end + 24, place + 4, title, class_="name"))
