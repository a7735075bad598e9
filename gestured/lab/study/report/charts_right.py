"""The charts of who is right how often: the paper's figures and ours, where it fails, how sure it is."""

from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.ticker import MaxNLocator, PercentFormatter

from . import formats, reading
from .drawing import DASHES, GRID, INK, SOFT, Drawing, Mark, mark_of
from .reading import Row, Study

PUBLISHED = Mark(5)
PROTOCOLS = {
    "paper": (Mark(1, "f1", 1), "ours, paper's protocol"),
    "padded": (Mark(1, "f1", 2), "ours, padded to the longest"),
    "clean": (Mark(2, "f2"), "ours, clean"),
    "participants": (Mark(0, "f0"), "ours, participants held out"),
    "real": (Mark(4, "f3"), "ours, real recordings"),
    "foreign": (Mark(4, "f3", 1), "ours, another generator"),
    "online": (Mark(3, "f4"), "ours, online"),
}
MARKS = dict.fromkeys(
    [Mark(k, f"f{k}", filling) for k in range(len(reading.FAMILIES)) for filling in range(len(DASHES))]
    + [PUBLISHED, *(mark for mark, _ in PROTOCOLS.values())]
)
LANE = 9.0  # pixels of one protocol's line
QUARTERS = (0, 0.25, 0.5, 0.75, 1)
MANY = 10  # groups; more are drawn in order of their share instead of by name


def shares(axes: Axes, floor: float, ceiling: float = 1.0, side: str = "x") -> None:
    """An axis of shares in per cent."""
    axis = axes.xaxis if side == "x" else axes.yaxis
    axis.set_major_locator(MaxNLocator(5, steps=(1, 2, 5, 10)))
    axis.set_major_formatter(PercentFormatter(1, decimals=0, symbol=""))
    (axes.set_xlim if side == "x" else axes.set_ylim)(floor, ceiling)


def share(drawing: Drawing, axes: Axes, row: Row, y: float, mark: Mark, words: str) -> None:
    """A share and its interval on a level line."""
    low, high = reading.ends(row)
    axes.plot([low, high], [y, y], color=mark.hue, linewidth=1.8, clip_on=False)
    told = f"{words}: {formats.with_unit(row['right'])} ({formats.interval(row)})"
    drawing.point(axes, row["right"], y, mark, told)


def overview(study: Study) -> Markup:
    """Each method a row, each augmentation a panel: the published figure and ours under each protocol."""
    found = [name for name in reading.AUGMENTATIONS if reading.cells(study, augmentation=name)]
    methods = reading.in_order(study, {row["method"] for row in reading.cells(study)})
    lanes = [name for name in PROTOCOLS if reading.cells(study, protocol=name)]
    pitch = LANE * len(lanes) + 15
    drawing = Drawing(196 + 268 * len(found), 74 + pitch * len(methods))
    panels = drawing.figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    for axes, augmentation in zip(panels, found, strict=True):
        axes.set_title(reading.AUGMENTATIONS[augmentation], color=INK, fontweight="bold")
        axes.grid(axis="x")
        axes.grid(axis="y", visible=False)
        axes.hlines([k + 0.5 for k in range(len(methods) - 1)], 0, 1, GRID, linewidth=1)
        shares(axes, reading.floor(study))
        axes.set_ylim(len(methods) - 0.5, -0.5)
        axes.set_yticks(range(len(methods)), [reading.title(study, method) for method in methods], color=INK)
        for k, method in enumerate(methods):
            title, published = reading.title(study, method), reading.published(study, method, augmentation)
            if published is not None:
                (bar,) = axes.plot([published] * 2, [k - 0.4, k + 0.4], color=INK, linewidth=4, solid_capstyle="butt")
                drawing.tell(bar, f"{title}, published: {formats.with_unit(published)}")
            for lane, protocol in enumerate(lanes):
                row = reading.cell(study, method, augmentation, protocol)
                if row is not None:
                    y = k + LANE * (lane - (len(lanes) - 1) / 2) / pitch
                    share(drawing, axes, row, y, PROTOCOLS[protocol][0], f"{title}, {protocol}")
    words = "Right in per cent, published and ours, for each method and protocol; the tables below say the same."
    return drawing.svg("The published figures and ours, simulated data", words)


def calibration(study: Study, row: Row) -> Markup:
    """A reliability diagram: the share that is right at each confidence; the larger a circle, the more answers."""
    drawing, mark = Drawing(300, 300), mark_of(study, row["method"])
    axes = drawing.figure.subplots()
    shares(axes, 0, 1)
    shares(axes, 0, 1, side="y")
    axes.set(xticks=QUARTERS, yticks=QUARTERS, title="right, per cent", xlabel="confidence, per cent")
    axes.plot([0, 1], [0, 1], color=SOFT, linewidth=1, linestyle=(0, (4, 4)))
    bins = [group for group in row["bins"] if group["n"]]
    at, right = [group["confidence"] for group in bins], [group["right"] for group in bins]
    axes.plot(at, right, color=mark.hue, linewidth=1.2, linestyle=mark.dashes)
    total = sum(group["n"] for group in bins)
    for group in bins:
        confidence, share = formats.percent(group["confidence"]), formats.percent(group["right"])
        words = f"confidence {confidence}, right {share}, n = {group['n']}"
        size = 6 + 18 * (group["n"] / total) ** 0.5
        style = {"marker": "o", "fillstyle": "full", "markerfacecolor": to_rgba(mark.hue, 0.55), "markeredgewidth": 1}
        drawing.point(axes, group["confidence"], group["right"], mark, words, markersize=size, **style)
    title = f"Reliability diagram of {reading.title(study, row['method'])}, simulated data"
    return drawing.svg(title, f"Expected calibration error {formats.with_unit(row['error'])}.")


def failures(study: Study, title: str, rows: list[Row], floor: float) -> Markup:
    """Groups below each other with the methods on lines of their own; many groups in the order of their share."""
    draw = _ranked if max(len(row["groups"]) for row in rows) > MANY else _named
    drawing = draw(study, rows, floor)
    return drawing.svg(f"{title}: right in per cent, simulated data", reading.lowest(study, rows))


def _named(study: Study, rows: list[Row], floor: float) -> Drawing:
    names = reading.group_names(rows)
    pitch = 26 + 12 * len(rows)
    drawing = Drawing(340, 34 + pitch * len(names))
    axes = drawing.figure.subplots()
    shares(axes, floor)
    axes.set(ylim=(len(names), 0), yticks=[])
    axes.grid(axis="x")
    for k, name in enumerate(names):
        axes.text(floor, k + 10 / pitch, formats.plain(name), va="center")
        for line, row in enumerate(rows):
            for group in (group for group in row["groups"] if str(group["name"]) == name):
                words = f"{reading.title(study, row['method'])}, {formats.plain(name)}"
                share(drawing, axes, group, k + (28 + 12 * line) / pitch, mark_of(study, row["method"]), words)
    return drawing


def _ranked(study: Study, rows: list[Row], floor: float) -> Drawing:
    most = max(len(row["groups"]) for row in rows)
    drawing = Drawing(340, 300)
    axes = drawing.figure.subplots()
    shares(axes, floor, side="y")
    axes.set(title="right, per cent", xlim=(0.5, most + 0.5), xlabel=f"{most} groups, each method's own order")
    axes.set_xticks([1, most], ["lowest", "highest"])
    for row in rows:
        mark, groups = mark_of(study, row["method"]), sorted(row["groups"], key=lambda group: float(group["right"]))
        places = range(1, len(groups) + 1)
        axes.plot(places, [group["right"] for group in groups], color=mark.hue, linestyle=mark.dashes)
        for place, group in zip(places, groups, strict=True):
            words = f"{reading.title(study, row['method'])}, {group['name']}: {formats.with_unit(group['right'])}"
            drawing.point(axes, place, group["right"], mark, words, markeredgewidth=1, markersize=6)
    return drawing
