"""The page's figures: the paper's shares and ours, and which gesture is taken for which."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import PercentFormatter

from . import reading
from .drawing import GRID, INK, Mark, sheet
from .reading import Row, Study

PROTOCOLS = {
    "paper": Mark(1, "f1"), "padded": Mark(1, "f1", 2), "clean": Mark(2, "f2"), "participants": Mark(0, "f0"),
    "real": Mark(4, "f3"), "foreign": Mark(4, "f3", 1),
}  # fmt: skip
LANE, GAP = 9, 15  # pixels of one protocol's line, and between two methods
ACROSS = 4  # matrices beside each other


def overview(study: Study) -> Figure:
    """Each method a row, each augmentation a panel: the published figure and ours under each protocol."""
    found = [name for name in reading.AUGMENTATIONS if reading.cells(study, augmentation=name)]
    methods = reading.in_order(study, {row["method"] for row in study["cells"]})
    lanes = [name for name in PROTOCOLS if reading.cells(study, protocol=name)]
    pitch = LANE * len(lanes) + GAP
    figure = sheet(196 + 268 * len(found), 110 + pitch * len(methods))
    panels = figure.subplots(1, len(found), sharex=True, sharey=True, squeeze=False)[0]
    for axes, augmentation in zip(panels, found, strict=True):
        axes.set_title(reading.AUGMENTATIONS[augmentation], color=INK, fontweight="bold")
        axes.grid(axis="x")
        axes.grid(axis="y", visible=False)
        axes.hlines([k + 0.5 for k in range(len(methods) - 1)], 0, 1, GRID, linewidth=1)
        axes.set(xlim=(0, 1), ylim=(len(methods) - 0.5, -0.5))
        axes.xaxis.set_major_formatter(PercentFormatter(1, symbol=""))
        axes.set_yticks(range(len(methods)), [reading.title(study, method) for method in methods], color=INK)
        for k, method in enumerate(methods):
            published = reading.published(study, method, augmentation)
            if published is not None:
                axes.plot([published] * 2, [k - 0.4, k + 0.4], color=INK, linewidth=4, solid_capstyle="butt")
            for lane, protocol in enumerate(lanes):
                row = reading.usual(reading.cells(study, method=method, augmentation=augmentation, protocol=protocol))
                if row is not None:
                    _share(axes, row, k + LANE * (lane - (len(lanes) - 1) / 2) / pitch, PROTOCOLS[protocol])
    handles = [Line2D([], [], color=INK, linewidth=4), *(Line2D([], [], **PROTOCOLS[name].style) for name in lanes)]
    words = ["published", *(f"ours, {reading.PROTOCOLS[name]}" for name in lanes)]
    figure.legend(handles, words, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _share(axes: Axes, row: Row, y: float, mark: Mark) -> None:
    """A share and its interval on a level line."""
    axes.plot([row["low"], row["high"]], [y, y], color=mark.hue, linewidth=1.8, clip_on=False)
    mark.point(axes, row["right"], y)


def confusion(study: Study) -> Figure:
    """Of each method which gesture (row) is taken for which (column), in per cent of the row."""
    rows, names = reading.matrices(study), [name.replace("_", " ") for name in study["about"]["gestures"]]
    down = -(-len(rows) // ACROSS)
    figure = sheet(180 + 250 * min(ACROSS, len(rows)), 150 + 280 * down)
    panels = figure.subplots(down, min(ACROSS, len(rows)), sharey=True, squeeze=False).ravel()
    for axes in panels[len(rows) :]:
        axes.set_visible(False)
    for k, (axes, row) in enumerate(zip(panels, rows, strict=False)):
        counts = np.array(row["confusion"], float)
        shares = 100 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        axes.imshow(shares, cmap="Blues", vmin=0, vmax=140)  # no darker than that the number can be read
        axes.set_title(reading.title(study, row["method"]), color=INK)
        axes.grid(visible=False)
        below = names if k + ACROSS >= len(rows) else [""] * len(names)
        axes.set_xticks(range(len(names)), below, rotation=90)
        axes.set_yticks(range(len(names)), names)
        for i, j in np.argwhere(shares):
            axes.text(j, i, f"{shares[i, j]:.0f}", ha="center", va="center", fontsize=8)
    return figure
