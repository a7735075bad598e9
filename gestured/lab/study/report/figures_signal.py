"""What the gestures are: their movements, their raw signals, and one double tap frame by frame."""

from typing import Any

from . import formats, icons
from .chart import Plot, Scale, polyline, text
from .layout import SIMULATED, figure
from .markup import Markup, tag

WIDTH = 720.0
SIDE = 108.0  # of a snapshot


def gestures(names: list[str], signals: dict[str, Any]) -> Markup:
    """A card for each gesture: the movement, its name, and the signal of one performance."""
    moments = [moment for signal in signals.values() for moment in signal["times_s"]]
    span = (min(moments, default=0.0), max(moments, default=1.0))
    cards = []
    for name in names:
        signal = signals.get(name)
        drawn = _signal(name, signal, span) if signal and signal["times_s"] else Markup("")
        cards.append(tag("li", icons.icon(name, 84), tag("span", formats.plain(name), class_="name"), drawn))
    caption = "Dots are fingertips at the beginning; lines lead where they go."
    if signals:
        caption += (
            " Below, the raw signal of one performance, summed over the taxels: one time scale, each its own height."
        )
    return figure(
        "The ten gestures", SIMULATED if signals else "", caption, tag("ul", *cards, class_="cards"), wide=False
    )


def _signal(name: str, signal: dict[str, Any], span: tuple[float, float]) -> Markup:
    low, peak = min(0.0, *signal["sum"]), max(signal["sum"])
    plot = Plot(148, 62, Scale(*span, 2, 146), Scale(low, peak, 46, 4))
    points = list(zip(signal["times_s"], signal["sum"], strict=True))
    around = [(points[0][0], low), *points, (points[-1][0], low)]
    plot.add(tag("path", d=polyline(plot.at(around), "")[len('<path d="') :].split('"')[0] + "Z", class_="area"))
    plot.line(points, "signal")
    plot.add(tag("line", x1=2, x2=146, y1=46, y2=46, class_="axis"))
    begin, end = (f"{moment:.1f} s".replace("-", "\u2212") for moment in span)
    plot.add(text(2, 59, begin, class_="tick"), text(146, 59, end, "end", "tick"))
    words = f"{formats.plain(name)}: raw signal summed over the taxels, simulated data"
    return plot.svg(words, f"{len(points)} frames, {points[-1][0] - points[0][0]:.2f} s, highest sum {peak:.0f}.")


def double_tap(tap: dict[str, Any]) -> Markup:
    """Pressure over time with moments marked, and the frame of each moment below."""
    times, total, shots = tap["times_s"], tap["sum"], tap.get("snapshots") or []
    plot = Plot(
        WIDTH,
        400 if shots else 250,
        Scale(times[0], times[-1], 56, WIDTH - 20),
        Scale(min(0.0, *total), max(total) * 1.08, 190, 32),
    )
    plot.y_axis(plot.y.ticks(4), lambda value: f"{value:.0f}", "summed signal, raw counts")
    plot.x_axis(plot.x.ticks(7), lambda value: f"{round(value, 3):g} s".replace("-", "\u2212"))
    plot.line(list(zip(times, total, strict=True)), "signal")
    for moment, value in zip(times, total, strict=True):
        plot.add(tag("circle", cx=plot.x(moment), cy=plot.y(value), r=2.4, class_="sample"))
    peak = max((value for shot in shots for row in shot["frame"] for value in row), default=1.0)
    pitch = (WIDTH - 40) / max(len(shots), 1)
    side = min(SIDE, pitch - 14)
    for k, shot in enumerate(shots):
        nearest = min(range(len(times)), key=lambda n: abs(times[n] - shot["t_s"]))
        x, y, middle = plot.x(times[nearest]), plot.y(total[nearest]), 20 + pitch * (k + 0.5)
        plot.add(tag("path", d=f"M{x:.1f} {y:.1f}V214L{middle:.1f} 244V256", class_="leader"))
        plot.add(tag("circle", cx=x, cy=y, r=5, class_="moment"))
        plot.add(snapshot(shot["frame"], middle - side / 2, 258, side, peak, f"the frame after {shot['t_s']:.2f} s"))
        plot.add(text(middle, 258 + side + 18, f"{shot['t_s']:.2f} s".replace("-", "\u2212"), "middle", "tick"))
    return figure(
        "A double tap, frame by frame",
        SIMULATED,
        "Pressure over time, and the sensor's frame at the marked moments; the stronger the colour, the more pressure.",
        plot.svg(
            "A double tap's pressure over time, simulated data", f"{len(shots)} frames as heat maps below the curve."
        ),
    )


def snapshot(frame: list[list[float]], x: float, y: float, side: float, peak: float, title: str) -> Markup:
    """One frame as a heat map on the scale of the whole gesture."""
    step = side / max(len(frame), *(len(row) for row in frame), 1)
    columns = max(len(row) for row in frame)
    parts = [tag("rect", x=x, y=y, width=step * columns, height=step * len(frame), class_="ground")]
    for j, row in enumerate(frame):
        for k, value in enumerate(row):
            depth = min(1.0, max(0.0, value / (peak or 1.0)))
            place = {"x": x + step * k, "y": y + step * j, "width": step, "height": step}
            if depth > 0.02:
                parts.append(tag("rect", **place, class_="heat", fill_opacity=round(depth, 2)))
    return tag("g", tag("title", title), *parts)
