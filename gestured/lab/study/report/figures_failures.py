"""Where the methods fail: by what was done, by whom, how and where."""

from . import formats, icons, marks, reading
from .chart import Plot, Scale, text
from .layout import SIMULATED, cell, folded, head, paragraph, row_head, small, table
from .markup import Markup, join, tag
from .reading import Row, Study

MANY = 10  # groups; more are drawn in order of their figure instead of by name
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


def failures(study: Study) -> Markup:
    """The best method of each family drawn, and every method in a table for each way of looking, folded."""
    rows = reading.part(study, "failures")
    kinds = [*KINDS, *sorted({row["by"] for row in rows} - set(KINDS))]
    found = {kind: of for kind in kinds if (of := [row for row in rows if row["by"] == kind and row["groups"]])}
    shown = _best_of_families(study, rows)
    drawn = {kind: [row for row in of if row["method"] in shown] for kind, of in found.items()}
    floor = reading.below(min(reading.ends(g)[0] for of in drawn.values() for row in of for g in row["groups"]))
    words = "Gestures of people never seen, in groups: right in per cent with 95 % intervals, on one scale throughout. "
    words += "Drawn is the method of each family that is most often right; the tables hold all of them."
    figures = [_groups(study, kind, of, floor) for kind, of in drawn.items() if of]
    tables = folded("All methods in figures", *(_table(study, kind, of) for kind, of in found.items()))
    return join(paragraph(words), marks.key(study, shown), tag("div", *figures, class_="multiples"), tables)


def _best_of_families(study: Study, rows: list[Row]) -> list[str]:
    """Of each family the method with the highest mean over the groups of the first way of looking."""
    first = [row for row in rows if row["by"] == rows[0]["by"] and row["groups"]]
    means = {row["method"]: sum(group["right"] for group in row["groups"]) / len(row["groups"]) for row in first}
    best: dict[int, str] = {}
    for method in sorted(means, key=lambda name: means[name]):
        best[reading.family(study, method)] = method
    return reading.in_order(study, set(best.values()))


def _table(study: Study, kind: str, rows: list[Row]) -> Markup:
    names, of = _names(rows), {row["method"]: row for row in rows}
    lines = []
    for method in reading.in_order(study, set(of)):
        groups = {str(group["name"]): group for group in of[method]["groups"]}
        lines.append([row_head(marks.named(study, method)), *(_cell(groups.get(name)) for name in names)])
    heads = [head("Method"), *(head(formats.plain(name)) for name in names)]
    return table(_title(kind), SIMULATED, "Right in per cent with 95 % intervals.", heads, lines)


def _cell(group: Row | None) -> Markup:
    if group is None:
        return cell(formats.NONE)
    share = tag("span", formats.percent(group["right"]), class_="share")
    return cell(share, " ", tag("span", formats.interval(group), class_="interval"), value=group["right"])


def _title(kind: str) -> str:
    return KINDS.get(kind, f"By {kind}")


def _names(rows: list[Row]) -> list[str]:
    return list(dict.fromkeys(str(group["name"]) for row in rows for group in row["groups"]))


def _groups(study: Study, kind: str, rows: list[Row], floor: float) -> Markup:
    many = max(len(row["groups"]) for row in rows) > MANY
    drawing = _ranked(study, kind, rows, floor) if many else _by_name(study, kind, rows, floor)
    return small(_title(kind), SIMULATED, _worst(study, rows), drawing)


def _worst(study: Study, rows: list[Row]) -> str:
    row, group = min(((row, group) for row in rows for group in row["groups"]), key=lambda pair: pair[1]["right"])
    name = f"{formats.plain(str(group['name']))}, {reading.title(study, row['method'])}"
    return f"Lowest: {name}, {formats.with_unit(group['right'])} of {formats.count(group['n'])}."


def _by_name(study: Study, kind: str, rows: list[Row], floor: float) -> Markup:
    """Groups below each other, the methods on lines of their own within each; gestures as icons, else a name above."""
    names = _names(rows)
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
    return plot.svg(f"{_title(kind)}: right in per cent, simulated data", _worst(study, rows))


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
    return plot.svg(f"{_title(kind)}: right in per cent, simulated data", _worst(study, rows))
