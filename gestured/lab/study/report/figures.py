"""The study's figure of which gesture is taken for which."""

import numpy as np
from matplotlib.figure import Figure

from . import reading
from .drawing import INK, sheet
from .reading import Study

ACROSS = 4  # matrices beside each other
TITLE = "Which gesture is taken for which"


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
