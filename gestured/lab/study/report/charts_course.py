"""The charts of what goes on in time, and with more people: signals, elapsed time, learning curves."""

from typing import Any

from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import ConnectionPatch, Rectangle
from matplotlib.ticker import FuncFormatter, MaxNLocator

from . import formats, reading
from .charts_right import shares
from .drawing import CARD, COLOURS, PAGE, SOFT, Drawing, mark_of
from .reading import Row, Study

AFTER = 2.4  # the width of one second after the end, on the axis of shares
SIGNAL, MOMENT, HEAT = COLOURS["f0"], COLOURS["f1"], COLOURS["deep"]
LINE = 17  # pixels between names below each other


def elapsed(study: Study) -> Markup:
    """Error after a part of the gesture, and after its end."""
    rows = [_errors(row) for row in reading.part(study, "elapsed")]
    drawing, axes = _wide()
    end = max(place for row in rows for place in row["x"])
    worst = max(error for row in rows for error in row["high"])
    shares(axes, 0, min(1.0, 1.05 * worst), side="y")
    label = "part of the gesture that has been seen, then time after its end"
    axes.set(title="error, per cent", xlim=(0.2, end + 0.02), xlabel=label)
    axes.set_xticks(sorted({place for row in rows for place in row["x"]}))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda place, _: _moment(place)))
    if end > 1:
        axes.axvspan(1, end + 0.02, color=CARD, zorder=0)
        axes.text(1, 1.02, "after the end", color=SOFT, transform=axes.get_xaxis_transform())
    return _lines(study, drawing, axes, rows, "Error against elapsed gesture time", "wrong")


def learning(study: Study) -> Markup:
    """How often new people's gestures are right, against the number of people learned from."""
    rows = [{**row, "x": row["participants"]} for row in reading.part(study, "learning")]
    drawing, axes = _wide()
    people = sorted({count for row in rows for count in row["x"]})
    shares(axes, reading.below(min(min(reading.bounds(row)[0]) for row in rows)), side="y")
    axes.set(title="right, per cent", xscale="log", xlabel="participants in the training set")
    axes.set_xlim(people[0] / 1.1, max(people[-1] * 1.05, people[0] * 2))
    axes.minorticks_off()
    axes.set_xticks(people, people)
    return _lines(study, drawing, axes, rows, "Learning curves", "right")


def _wide() -> tuple[Drawing, Axes]:
    drawing = Drawing(960, 400)
    return drawing, drawing.figure.subplots()


def _errors(row: Row) -> Row:
    low, high = reading.bounds(row)
    places = [round(at["share"] if "share" in at else 1.0 + AFTER * at["after_s"], 6) for at in row["at"]]
    wrong = {"right": row["right"], "low": high, "high": low}
    return {**row, "x": places, **{name: [1 - share for share in of] for name, of in wrong.items()}}


def _moment(place: float) -> str:
    return f"{100 * place:.0f} %" if place <= 1.0 else f"+{1000 * (place - 1.0) / AFTER:.0f} ms"


def _lines(study: Study, drawing: Drawing, axes: Axes, rows: list[Row], title: str, words: str) -> Markup:
    """Bands below, then lines with their marks, and each method's name at the end of its line."""
    told = []
    for row in rows:
        mark, method = mark_of(study, row["method"]), reading.title(study, row["method"])
        axes.fill_between(row["x"], *reading.bounds(row), color=mark.hue, alpha=0.12, linewidth=0)
        axes.plot(row["x"], row["right"], color=mark.hue, linestyle=mark.dashes)
        for x, share in zip(row["x"], row["right"], strict=True):
            drawing.point(axes, x, share, mark, f"{method}: {formats.with_unit(share)}")
        told.append(f"{method}: {formats.with_unit(row['right'][-1])} {words} at the end")
    (bottom, top), ends = axes.get_ylim(), sorted((row["right"][-1], row["x"][-1], row["method"]) for row in rows)
    places = _spread([end for end, *_ in ends], (top - bottom) * LINE / 320, top)
    for (end, x, method), place in zip(ends, places, strict=True):
        axes.annotate(
            reading.title(study, method), (x, end), (1.03, place), textcoords=axes.get_yaxis_transform(), va="center",
            arrowprops={"arrowstyle": "-", "color": SOFT, "linewidth": 0.8, "relpos": (0, 0.5), "shrinkB": 7},
        )  # fmt: skip
    return drawing.svg(f"{title}, simulated data", "; ".join(told))


def _spread(places: list[float], gap: float, top: float) -> list[float]:
    """Sorted places moved as little as need be, so that neighbours are `gap` apart and none is above the top."""
    for k in range(1, len(places)):
        places[k] = max(places[k], places[k - 1] + gap)
    for k in reversed(range(len(places))):
        places[k] = min(places[k], top - gap * (len(places) - 1 - k))
    return places


def signal(gesture: str, signals: dict[str, Row]) -> Markup:
    """The raw signal of one performance; the height is its own, the time scale that of all."""
    times, total = signals[gesture]["times_s"], signals[gesture]["sum"]
    if not times:
        return Markup()
    moments = [moment for found in signals.values() for moment in found["times_s"]]
    span = min(moments), max(moments)
    drawing = Drawing(148, 62, None)
    axes = drawing.figure.add_axes((2 / 148, 16 / 62, 144 / 148, 42 / 62))
    axes.fill_between(times, total, min(0.0, *total), color=SIGNAL, alpha=0.14, linewidth=0)
    axes.plot(times, total, color=SIGNAL, linewidth=1.8, clip_on=False)
    axes.set(xlim=span, ylim=(min(0.0, *total), max(total) or 1.0), xticks=[], yticks=[])
    for place, moment, align in ((0.0, span[0], "left"), (1.0, span[1], "right")):
        axes.text(place, -0.06, _seconds(moment, ".1f"), color=SOFT, ha=align, va="top", transform=axes.transAxes)
    words = f"{formats.plain(gesture)}: raw signal summed over the taxels, simulated data"
    return drawing.svg(words, f"{len(times)} frames, {times[-1] - times[0]:.2f} s, highest sum {max(total):.0f}.")


def double_tap(tap: Row) -> Markup:
    """Pressure over time with moments marked, and the frame of each moment below, on one scale of colour."""
    times, total, shots = tap["times_s"], tap["sum"], tap.get("snapshots") or []
    drawing = Drawing(720, 400 if shots else 250)
    grid = drawing.figure.add_gridspec(5, max(len(shots), 1), wspace=0.2, hspace=0.1)
    axes = drawing.figure.add_subplot(grid[:3, :] if shots else grid[:, :])
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.plot(times, total, color=SIGNAL, marker="o", markersize=4, clip_on=False)
    axes.set(title="summed signal, raw counts", xlim=(times[0], times[-1]), ylim=(min(0.0, *total), 1.08 * max(total)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda moment, _: _seconds(moment, "g")))
    peak = max((value for shot in shots for row in shot["frame"] for value in row), default=0.0) or 1.0
    for k, shot in enumerate(shots):
        nearest = min(range(len(times)), key=lambda n: abs(times[n] - shot["t_s"]))
        at, below = (times[nearest], total[nearest]), drawing.figure.add_subplot(grid[3:, k])
        style: dict[str, Any] = {
            "markersize": 10,
            "markerfacecolor": PAGE,
            "markeredgecolor": MOMENT,
            "markeredgewidth": 2.4,
        }
        (moment,) = axes.plot(*at, marker="o", linestyle="", clip_on=False, **style)
        drawing.tell(moment, f"the frame after {shot['t_s']:.2f} s")
        _frame(below, shot["frame"], peak)
        below.set_xlabel(_seconds(shot["t_s"], ".2f"))
        style = {"color": SOFT, "linewidth": 0.8, "zorder": 1.5}
        foot, data, level = (at[0], -0.2), axes.transData, axes.get_xaxis_transform()
        drawing.figure.add_artist(ConnectionPatch(at, foot, coordsA=data, coordsB=level, **style))
        drawing.figure.add_artist(ConnectionPatch(foot, (0.5, 1), coordsA=level, coordsB=below.transAxes, **style))
    return drawing.svg(
        "A double tap's pressure over time, simulated data", f"{len(shots)} frames as heat maps below the curve."
    )


def _frame(axes: Axes, frame: list[list[float]], peak: float) -> None:
    """A frame as a heat map; taxels are drawn one by one, because their colour is the page's."""
    deep = [(row, column, value / peak) for row, line in enumerate(frame) for column, value in enumerate(line)]
    deep = [(row, column, min(1.0, depth)) for row, column, depth in deep if depth > 0.02]
    axes.set(xlim=(0, len(frame[0])), ylim=(len(frame), 0), aspect="equal", xticks=[], yticks=[], facecolor=CARD)
    axes.spines["bottom"].set_visible(False)
    boxes = [Rectangle((column, row), 1, 1) for row, column, _ in deep]
    axes.add_collection(PatchCollection(boxes, facecolors=[to_rgba(HEAT, round(depth, 2)) for *_, depth in deep]))


def _seconds(moment: float, form: str) -> str:
    return f"{round(moment, 3):{form}} s".replace("-", "\u2212")
