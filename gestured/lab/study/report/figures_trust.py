"""How far the figures carry: more people, how sure the answers are, and where they fail."""

from . import formats, icons, marks, reading
from .chart import Plot, Scale, text
from .figures_time import WIDTH, curves
from .layout import SIMULATED, figure
from .markup import Markup, join, tag
from .reading import Row, Study

MANY = 12  # groups; more are drawn in order of their figure instead of by name
KINDS = {
    "gesture": "By gesture",
    "speed": "By speed",
    "inclination": "By the sensor's inclination",
    "participant": "By participant",
    "hand size": "By hand size",
    "pressure": "By pressure",
    "place": "By place on the sensor",
    "signal to noise": "By signal to noise",
}


def learning(study: Study) -> Markup:
    rows = reading.part(study, "learning")
    people = sorted({count for row in rows for count in row["participants"]})
    lowest = min(low for row in rows for low in row["low"])
    x = Scale(people[0] / 1.1, max(people[-1] * 1.05, people[0] * 2), 56, WIDTH - 230, log=True)
    plot = Plot(WIDTH, 400, x, Scale(max(0.0, int(lowest * 10) / 10), 1.0, 336, 36))
    plot.y_axis(plot.y.ticks(), lambda share: formats.percent(share, 0), "right, per cent")
    plot.x_axis(people, lambda count: f"{count:.0f}", "participants in the training set")
    curves(study, plot, [(row["method"], [float(n) for n in row["participants"]], row) for row in rows])
    return figure(
        "Learning curves",
        SIMULATED,
        "How often new people's gestures are right, against the number of people that a method was fitted on.",
        marks.key(study, [row["method"] for row in rows]),
        plot.svg("Learning curves, simulated data", "One rising curve for each method."),
    )


def calibration(study: Study) -> Markup:
    drawings = [_reliability(study, row) for row in reading.part(study, "calibration")]
    return tag("div", *drawings, class_="multiples")


def _reliability(study: Study, row: Row) -> Markup:
    plot = Plot(300, 300, Scale(0.0, 1.0, 46, 286), Scale(0.0, 1.0, 250, 28))
    shares = [0.0, 0.25, 0.5, 0.75, 1.0]
    plot.y_axis(shares, lambda share: formats.percent(share, 0), "right, per cent")
    plot.x_axis(shares, lambda share: formats.percent(share, 0), "confidence, per cent")
    plot.line([(0.0, 0.0), (1.0, 1.0)], "ideal")
    look = marks.look_of(study, row["method"])
    bins = [group for group in row["bins"] if group["n"]]
    total = sum(group["n"] for group in bins) or 1
    if bins:
        plot.line([(group["confidence"], group["right"]) for group in bins], f"curve {look.classes}")
    for group in bins:
        sure, right = formats.percent(group["confidence"]), formats.percent(group["right"])
        words = f"confidence {sure}, right {right}, n = {group['n']}"
        radius = 3 + 9 * (group["n"] / total) ** 0.5
        x, y = plot.x(group["confidence"]), plot.y(group["right"])
        drawn = tag("circle", cx=x, cy=y, r=radius, class_=f"bubble {look.classes}")
        plot.add(tag("g", tag("title", words), drawn))
    title = f"{reading.title(study, row['method'])}, simulated data"
    words = f"Expected calibration error {formats.with_unit(row['error'])}."
    drawing = plot.svg(f"Reliability diagram. {title}", words)
    return tag("figure", tag("figcaption", tag("strong", title), " ", tag("span", words, class_="words")), drawing)


def failures(study: Study) -> Markup:
    rows = reading.part(study, "failures")
    methods = reading.in_order(study, {row["method"] for row in rows})
    kinds = [*(kind for kind in KINDS if any(row["by"] == kind for row in rows))]
    kinds += sorted({row["by"] for row in rows} - set(KINDS))
    drawings = [_groups(study, kind, [row for row in rows if row["by"] == kind]) for kind in kinds]
    return join(marks.key(study, methods), tag("div", *drawings, class_="multiples"))


def _groups(study: Study, kind: str, rows: list[Row]) -> Markup:
    many = max(len(row["groups"]) for row in rows) > MANY
    drawing = _ranked(study, kind, rows) if many else _by_name(study, kind, rows)
    title = f"{KINDS.get(kind, f'By {kind}')}, simulated data"
    return tag(
        "figure",
        tag("figcaption", tag("strong", title), " ", tag("span", _worst(study, rows), class_="words")),
        drawing,
    )


def _worst(study: Study, rows: list[Row]) -> str:
    row, group = min(((row, group) for row in rows for group in row["groups"]), key=lambda pair: pair[1]["right"])
    name = f"{formats.plain(str(group['name']))}, {reading.title(study, row['method'])}"
    return f"Lowest: {name}, {formats.with_unit(group['right'])} of {formats.count(group['n'])}."


def _floor(rows: list[Row]) -> float:
    return max(0.0, int(10 * min(group["low"] for row in rows for group in row["groups"])) / 10)


def _by_name(study: Study, kind: str, rows: list[Row]) -> Markup:
    """Groups below each other, the methods on lines of their own within each."""
    names = list(dict.fromkeys(str(group["name"]) for row in rows for group in row["groups"]))
    pitch = 12.0 * len(rows) + 10
    height = 12 + pitch * len(names) + 30
    left = 44.0 if kind == "gesture" else 108.0
    plot = Plot(340, height, Scale(_floor(rows), 1.0, left, 326), Scale(0, len(names), 8, height - 30))
    plot.x_axis(plot.x.ticks(4), lambda share: formats.percent(share, 0), grid=True)
    for k, name in enumerate(names):
        middle = plot.y(k + 0.5)
        drawn = (
            icons.placed(name, 20, middle, 26)
            if kind == "gesture"
            else text(left - 10, middle + 4, name, "end", "name")
        )
        plot.add(drawn)
        for lane, row in enumerate(rows):
            for group in (group for group in row["groups"] if str(group["name"]) == name):
                _share(study, plot, row, group, middle + 12 * (lane - (len(rows) - 1) / 2))
    return plot.svg(f"{KINDS.get(kind, kind)}: right in per cent, simulated data", _worst(study, rows))


def _share(study: Study, plot: Plot, row: Row, group: Row, y: float) -> None:
    look = marks.look_of(study, row["method"])
    method, name = reading.title(study, row["method"]), formats.plain(str(group["name"]))
    words = f"{method}, {name}: {formats.with_unit(group['right'])}"
    plot.add(marks.whisker(plot.x(group["low"]), y, plot.x(group["high"]), y, look.classes))
    plot.add(
        marks.marker(look, plot.x(group["right"]), y, f"{words} ({formats.interval(group)}), n = {group['n']}", "small")
    )


def _ranked(study: Study, kind: str, rows: list[Row]) -> Markup:
    """So many groups that their names do not matter: from the lowest to the highest."""
    most = max(len(row["groups"]) for row in rows)
    plot = Plot(340, 300, Scale(0.5, most + 0.5, 40, 330), Scale(_floor(rows), 1.0, 250, 24))
    plot.y_axis(plot.y.ticks(4), lambda share: formats.percent(share, 0), "right, per cent")
    plot.x_axis(
        [1.0, float(most)],
        lambda place: "lowest" if place == 1.0 else "highest",
        f"{most} groups, each method's own order",
    )
    for row in rows:
        look = marks.look_of(study, row["method"])
        groups = sorted(row["groups"], key=lambda group: group["right"])
        plot.line([(k + 1.0, group["right"]) for k, group in enumerate(groups)], f"curve {look.classes}")
        for k, group in enumerate(groups):
            words = f"{reading.title(study, row['method'])}, {group['name']}: {formats.with_unit(group['right'])}"
            plot.add(marks.marker(look, plot.x(k + 1.0), plot.y(group["right"]), words, "tiny"))
    return plot.svg(f"{KINDS.get(kind, kind)}: right in per cent, simulated data", _worst(study, rows))
