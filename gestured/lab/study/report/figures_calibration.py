"""How sure the answers are: reliability diagrams."""

from . import formats, marks, reading
from .chart import Plot, Scale
from .layout import SIMULATED, paragraph, small
from .markup import Markup, join, tag
from .reading import Row, Study


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
