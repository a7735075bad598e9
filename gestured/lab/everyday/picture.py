"""The curve: gestures that were missed or wrong against false ones an hour, with every threshold, as SVG."""

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from gestured.lab.drawing import INK, SOFT, sheet, styled, svg
from gestured.lab.everyday.report import RULED, Figures, not_right

WIDTH, HEIGHT = 700, 460  # pixels
MODELS = (("#0067a5", "o"), ("#b9480a", "s"), ("#96498a", "^"), ("#007a5a", "D"))  # colour and mark of each in turn
LEAST_SHARE = 0.005  # a logarithm cannot show 0; lower shares are drawn here
TITLE = "Missed or wrong against false gestures an hour"


def draw(found: Figures) -> str:
    """The picture of `figures`, as an SVG file that is the same each time."""
    with styled():
        return svg(_figure(found), TITLE)


def _figure(found: Figures) -> Figure:
    least = 0.5 / found["hours"]  # no false gesture is drawn as half a one
    figure = sheet(WIDTH, HEIGHT)
    axes = figure.subplots()
    axes.loglog()
    axes.minorticks_off()
    axes.grid(axis="x")
    axes.set_title("Gestures meant that were missed or taken for another, per cent", color=INK, fontweight="bold")
    axes.set_xlabel(f"false gestures an hour, in {found['hours']:.3g} hours; none is drawn as half a one")
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda rate, _: f"{rate:g}"))
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g}" if share <= 1 else ""))
    axes.axvline(RULED, color=INK, linewidth=1, linestyle=(0, (4, 3)))
    axes.annotate(
        f"{RULED:g} an hour", (RULED, 0.0), (5, 6), xycoords=("data", "axes fraction"), textcoords="offset points",
        color=SOFT,
    )  # fmt: skip
    for k, (name, rows) in enumerate(found["curves"].items()):
        colour, mark = MODELS[k % len(MODELS)]
        places = [_place(row, least) for row in rows]
        axes.plot(*zip(*places, strict=True), color=colour, label=name)
        for point, of in found["points"][name].items():
            x, y = _place(of, least)
            axes.plot([x], [y], mark, color=colour, markersize=9, clip_on=False, zorder=3)
            if k == 0:
                axes.annotate(point, (x, y), (9, 9), textcoords="offset points", color=colour, fontweight="bold")
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    return figure


def _place(row: dict[str, float | None], least: float) -> tuple[float, float]:
    return max(row["false_per_hour"] or 0.0, least), max(not_right(row) or 0.0, LEAST_SHARE)
