"""Who is right how often: published and ours side by side, and which gestures are taken for which."""

from . import formats, icons, marks, reading
from .chart import Plot, Scale, text
from .layout import REAL, SIMULATED, figure, small
from .markup import Markup, join, svg, tag
from .reading import Row, Study

PANEL, LABELS, LANE = 268.0, 196.0, 9.0  # pixels: one panel, the names before them, one protocol's line
FORMS = {  # of the protocols: form, colour and words
    "paper": ("square", "f1 v1", "ours, paper's protocol"),
    "clean": ("triangle", "f2 v0", "ours, clean"),
    "participants": ("circle", "f0 v0", "ours, participants held out"),
    "real": ("star", "f3 v0", "ours, real recordings"),
    "online": ("diamond", "f4 v0", "ours, online"),
}
CELL = 27.0  # of a confusion matrix
DEEPEST = 0.58  # of a colour behind a number that must be read, on a light and on a dark page


def overview(study: Study) -> Markup:
    """Each method a row, each augmentation a panel: the published figure and ours under each protocol."""
    found = [name for name in reading.AUGMENTATIONS if reading.cells(study, augmentation=name)]
    methods = reading.in_order(study, {row["method"] for row in reading.cells(study)})
    protocols = [name for name in FORMS if reading.cells(study, protocol=name)]
    pitch = LANE * len(protocols) + 15
    height = 44 + pitch * len(methods) + 30
    panels = [
        _panel(study, methods, protocols, name, LABELS + k * PANEL, height, pitch) for k, name in enumerate(found)
    ]
    names = [
        text(0, 44 + pitch * (k + 0.5), reading.title(study, method), class_="name") for k, method in enumerate(methods)
    ]
    title = "The published figures and ours, simulated data"
    words = "Right in per cent, published and ours, for each method and protocol; the tables below say the same."
    drawing = svg(LABELS + PANEL * len(found) + 4, height, title, words, *names, *panels)
    entries = [("bar", "published-key", "published (textile, 34 participants)"), *(FORMS[name] for name in protocols)]
    return figure(
        "Published and measured",
        SIMULATED if "real" not in protocols else "simulated data, but for “real”",
        "Share of gestures that are right; lines are 95 % intervals over participants. The paper's hyperparameters, "
        "tuned ones where the paper gives none.",
        marks.form_key(entries),
        drawing,
    )


def _panel(
    study: Study, methods: list[str], protocols: list[str], augmentation: str, left: float, height: float, pitch: float
) -> Markup:
    plot = Plot(
        PANEL,
        height,
        Scale(reading.floor(study), 1.0, left + 14, left + PANEL - 16),
        Scale(0, len(methods), 40, height - 30),
    )
    plot.add(text(left + 14, 20, reading.AUGMENTATIONS[augmentation], class_="panel"))
    plot.x_axis(plot.x.ticks(5), lambda share: formats.percent(share, 0), grid=True)
    for k, method in enumerate(methods):
        if k:
            plot.add(tag("line", x1=plot.x.start, x2=plot.x.end, y1=plot.y(k), y2=plot.y(k), class_="rule"))
        figure_in_paper = reading.published(study, method, augmentation)
        if figure_in_paper is not None:
            x, y = plot.x(figure_in_paper), plot.y(k)
            words = f"{reading.title(study, method)}, published: {formats.with_unit(figure_in_paper)}"
            bar = tag("rect", x=x - 2, y=y + 5, width=4, height=pitch - 10, class_="published-bar")
            plot.add(tag("g", tag("title", words), bar))
        for lane, protocol in enumerate(protocols):
            row = reading.cell(study, method, augmentation, protocol)
            if row is not None:
                plot.add(_share(plot, row, plot.y(k) + 7.5 + LANE * (lane + 0.5), protocol, study))
    return join(*plot.parts)


def _share(plot: Plot, row: Row, y: float, protocol: str, study: Study) -> Markup:
    name, classes, _ = FORMS[protocol]
    method, right = reading.title(study, row["method"]), float(row["right"])
    words = f"{method}, {protocol}: {formats.with_unit(right)} ({formats.interval(row)})"
    low, high = (plot.x(end) for end in reading.ends(row))
    return join(marks.whisker(low, y, high, y, classes), marks.form(name, plot.x(right), y, classes + " small", words))


def confusions(study: Study) -> Markup:
    """One small matrix for each method."""
    names: list[str] = list((study.get("about") or {}).get("gestures") or [])
    methods = reading.in_order(study, {row["method"] for row in reading.cells(study) if row.get("confusion")})
    return tag("div", *(_confusion(study, method, names) for method in methods), class_="multiples")


def _confusion(study: Study, method: str, names: list[str]) -> Markup:
    row = reading.shown(study, method)
    assert row is not None
    matrix = row["confusion"]
    names = names if len(names) == len(matrix) else [str(k + 1) for k in range(len(matrix))]
    edge = 30.0
    parts = []
    for k, name in enumerate(names):
        centre = edge + CELL * (k + 0.5)
        parts += [icons.placed(name, 14, centre, 22), icons.placed(name, centre, 14, 22)]
    for j, counts in enumerate(matrix):
        total = sum(counts) or 1
        for k, count in enumerate(counts):
            parts.append(_square(j, k, count, count / total, edge, names))
    side = edge + CELL * len(matrix) + 2
    title, source = reading.title(study, method), REAL if row["data"] == "real" else SIMULATED
    words = _most_often(matrix, names)
    drawing = svg(side, side, f"Confusion matrix of {title}, {source}", words, *parts, class_="matrix")
    setting = f"{row['protocol']} · {row['settings']} · {row['augmentation']}"
    return small(title, source, f"{formats.with_unit(row['right'])} right ({setting}). {words}", drawing)


def _square(j: int, k: int, count: int, share: float, edge: float, names: list[str]) -> Markup:
    x, y = edge + CELL * k, edge + CELL * j
    place = {"x": x + 0.5, "y": y + 0.5, "width": CELL - 1, "height": CELL - 1}
    box = tag("rect", **place, class_="ground")
    if not count:
        return box
    # A square root, so that the few that go wrong are seen beside the many that do not.
    depth = DEEPEST * (share if j == k else min(1.0, share**0.5 * 1.25))
    shade = tag("rect", **place, class_="hit" if j == k else "miss", fill_opacity=depth)
    written = text(x + CELL / 2, y + CELL / 2 + 4, f"{100 * share:.0f}", "middle", "count")
    words = f"{formats.plain(names[j])} taken for {formats.plain(names[k])}: {count}, {100 * share:.1f} %"
    return tag("g", tag("title", words), box, shade, written)


def _most_often(matrix: list[list[int]], names: list[str]) -> str:
    """The two gravest confusions, in words."""
    wrong = [
        (count / (sum(counts) or 1), count, sum(counts), j, k)
        for j, counts in enumerate(matrix)
        for k, count in enumerate(counts)
        if j != k and count
    ]
    if not wrong:
        return "No gesture is taken for another."
    told = [
        f"{formats.plain(names[j])} taken for {formats.plain(names[k])} ({count} of {total})"
        for _, count, total, j, k in sorted(wrong, reverse=True)[:2]
    ]
    return "Most often: " + ", then ".join(told) + "."
