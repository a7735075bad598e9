"""How far the figures carry: how sure the answers are, and where they fail."""

from . import formats, icons, marks, reading
from .chart import Plot, Scale, text
from .layout import SIMULATED, paragraph, small
from .markup import Markup, join, tag
from .reading import Row, Study

MANY = 12  # groups; more are drawn in order of their figure instead of by name
KINDS = {
    "gesture": "By gesture",
    "participant": "By participant",
    "signal to noise": "By signal to noise",
    "speed": "By speed",
    "inclination": "By inclination",
    "hand size": "By hand size",
    "pressure": "By pressure",
    "place": "By place on the sensor",
}


def calibration(study: Study) -> Markup:
    drawings = [_reliability(study, row) for row in reading.part(study, "calibration")]
    words = "How often an answer of a given confidence is right; the larger a circle, the more answers. "
    words += "On the dashed line confidence is what it says; below it, the method is too sure."
    return join(paragraph(words), tag("div", *drawings, class_="multiples"))


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
        plot.line([(group["confidence"], group["right"]) for group in bins], f"curve thin {look.classes}")
    for group in bins:
        sure, right = formats.percent(group["confidence"]), formats.percent(group["right"])
        words = f"confidence {sure}, right {right}, n = {group['n']}"
        radius = 3 + 9 * (group["n"] / total) ** 0.5
        x, y = plot.x(group["confidence"]), plot.y(group["right"])
        drawn = tag("circle", cx=x, cy=y, r=radius, class_=f"bubble {look.classes}")
        plot.add(tag("g", tag("title", words), drawn))
    title = reading.title(study, row["method"])
    words = f"Expected calibration error {formats.with_unit(row['error'])}."
    return small(title, SIMULATED, words, plot.svg(f"Reliability diagram of {title}, simulated data", words))


def failures(study: Study) -> Markup:
    rows = reading.part(study, "failures")
    methods = reading.in_order(study, {row["method"] for row in rows})
    kinds = [*(kind for kind in KINDS if any(row["by"] == kind for row in rows))]
    kinds += sorted({row["by"] for row in rows} - set(KINDS))
    floor = reading.below(min(reading.ends(group)[0] for row in rows for group in row["groups"]))
    drawings = [_groups(study, kind, [row for row in rows if row["by"] == kind], floor) for kind in kinds]
    words = (
        "Right in per cent with 95 % intervals, for groups of the gestures of people never seen; one scale throughout."
    )
    return join(paragraph(words), marks.key(study, methods), tag("div", *drawings, class_="multiples"))


def _groups(study: Study, kind: str, rows: list[Row], floor: float) -> Markup:
    many = max(len(row["groups"]) for row in rows) > MANY
    drawing = _ranked(study, kind, rows, floor) if many else _by_name(study, kind, rows, floor)
    return small(KINDS.get(kind, f"By {kind}"), SIMULATED, _worst(study, rows), drawing)


def _worst(study: Study, rows: list[Row]) -> str:
    row, group = min(((row, group) for row in rows for group in row["groups"]), key=lambda pair: pair[1]["right"])
    name = f"{formats.plain(str(group['name']))}, {reading.title(study, row['method'])}"
    return f"Lowest: {name}, {formats.with_unit(group['right'])} of {formats.count(group['n'])}."


def _by_name(study: Study, kind: str, rows: list[Row], floor: float) -> Markup:
    """Groups below each other, the methods on lines of their own within each; gestures as icons, else a name above."""
    names = list(dict.fromkeys(str(group["name"]) for row in rows for group in row["groups"]))
    icon = kind == "gesture"
    above, lane = (8.0 if icon else 22.0), 12.0
    pitch = above + lane * len(rows) + 4
    height = 8 + pitch * len(names) + 30
    x = Scale(floor, 1.0, 44 if icon else 14, 326)
    plot = Plot(340, height, x, Scale(0, len(names), 4, height - 30))
    plot.x_axis(x.ticks(), lambda share: formats.percent(share, 0), grid=True)
    for k, name in enumerate(names):
        top = plot.y(k)
        plot.add(icons.placed(name, 20, top + pitch / 2, 26) if icon else text(2, top + 16, name, class_="name"))
        for line, row in enumerate(rows):
            for group in (group for group in row["groups"] if str(group["name"]) == name):
                _share(study, plot, row, group, top + above + lane * (line + 0.5))
    return plot.svg(f"{KINDS.get(kind, kind)}: right in per cent, simulated data", _worst(study, rows))


def _share(study: Study, plot: Plot, row: Row, group: Row, y: float) -> None:
    look = marks.look_of(study, row["method"])
    method, name = reading.title(study, row["method"]), formats.plain(str(group["name"]))
    words, (low, high) = f"{method}, {name}: {formats.with_unit(group['right'])}", reading.ends(group)
    plot.add(marks.whisker(plot.x(low), y, plot.x(high), y, look.classes))
    plot.add(
        marks.marker(look, plot.x(group["right"]), y, f"{words} ({formats.interval(group)}), n = {group['n']}", "small")
    )


def _ranked(study: Study, kind: str, rows: list[Row], floor: float) -> Markup:
    """So many groups that their names do not matter: from the lowest to the highest."""
    most = max(len(row["groups"]) for row in rows)
    plot = Plot(340, 300, Scale(0.5, most + 0.5, 44, 322), Scale(floor, 1.0, 250, 24))
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
