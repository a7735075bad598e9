"""Error against run time as one self-contained SVG, on a ground of its own so that it can be read on any page."""

from collections.abc import Mapping, Sequence

from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from gestured.lab.stability.textbook import Point
from gestured.lab.study.report import formats
from gestured.lab.study.report.drawing import INK, Drawing, Mark, styled

WORST, BEST = 1e3, 1e-17  # errors that the axis ends at; what diverges is drawn at the top
TICKS = ("1e-16", "1e-12", "1e-8", "1e-4", "1")


def svg(panels: Mapping[str, Sequence[Point]]) -> str:
    """One panel beside the other: each method a line, its points the numbers of steps a frame."""
    methods = list(dict.fromkeys(point.method for points in panels.values() for point in points))
    marks = {method: Mark(k % 5, f"f{k % 5}", k // 5) for k, method in enumerate(methods)}
    with styled():
        drawing = Drawing(470 * len(panels), 380 + 20 * len(methods))
        found = drawing.figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
        for axes, (title, points) in zip(found, panels.items(), strict=True):
            axes.loglog()
            axes.minorticks_off()
            axes.set_ylim(BEST, WORST)
            axes.set_yticks([*map(float, TICKS), WORST], [*TICKS, "diverges"])
            axes.xaxis.set_major_formatter(FuncFormatter(lambda seconds, _: formats.duration(seconds, 1)))
            axes.set_title(title, color=INK, fontweight="bold")
            axes.set_xlabel("processor time a frame; up: largest error")
            axes.grid(axis="x")
            for method, mark in marks.items():
                own = [(point, min(max(point.error, BEST), WORST)) for point in points if point.method == method]
                axes.plot(
                    [point.seconds for point, _ in own], [error for _, error in own], color=mark.hue, linewidth=1.5
                )
                for point, error in own:
                    words = f"{method}, {point.substeps} steps a frame: {point.error:.2g}, {1e6 * point.seconds:.2g} us"
                    size = {} if point.substeps == 1 else {"markersize": 0.6 * mark.style["markersize"]}
                    drawing.point(axes, point.seconds, error, mark, words, **size)
        key = [Line2D([], [], label=method, **mark.style | {"linestyle": ""}) for method, mark in marks.items()]
        drawing.figure.legend(handles=key, loc="outside lower left", frameon=False)
        return drawing.alone("A first-order filter: largest error against run time, by method and steps a frame")
