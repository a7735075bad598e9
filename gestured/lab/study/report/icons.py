"""The ten gestures drawn as movements of the fingers, on a square of 64."""

from math import cos, hypot, pi, sin

from .chart import Point
from .formats import plain
from .markup import Markup, join, svg, tag

TIP = 5.5  # radius of a fingertip
HEAD = 9.0  # length of an arrow's head


def drawing(gesture: str) -> Markup:
    """The strokes of one gesture; a question mark where it is none of the ten."""
    if gesture in ("one_tap", "double_tap"):
        rings = (13.0,) if gesture == "one_tap" else (13.0, 22.0)
        return join(_tip((32, 32)), *(tag("circle", cx=32, cy=32, r=radius, class_="stroke") for radius in rings))
    if gesture.startswith("circle_"):
        return _circle(1.0 if gesture == "circle_clockwise" else -1.0)
    direction = gesture.removeprefix("swipe_").removesuffix("_two_fingers")
    step = {"up": (0, -1), "down": (0, 1), "left": (-1, 0), "right": (1, 0)}.get(direction)
    if step is None:
        return tag("text", "?", x=32, y=42, text_anchor="middle", class_="unknown")
    sideways = (-12, 12) if gesture.endswith("_two_fingers") else (0,)
    return join(*(_arrow(step, shift) for shift in sideways))


def icon(gesture: str, size: float) -> Markup:
    """A picture of its own, named for the gesture."""
    scaled = tag("g", drawing(gesture), transform=f"scale({size / 64:.4f})", class_="gesture")
    return svg(size, size, plain(gesture), "", scaled, class_="icon")


def placed(gesture: str, x: float, y: float, size: float) -> Markup:
    """The same within a chart, centred on (x, y)."""
    place = f"translate({x - size / 2:.1f} {y - size / 2:.1f}) scale({size / 64:.4f})"
    return tag("g", tag("title", plain(gesture)), drawing(gesture), transform=place, class_="gesture")


def _arrow(step: tuple[int, int], shift: float) -> Markup:
    ahead, aside = 19.0, shift
    start = (32 - step[0] * ahead + step[1] * aside, 32 - step[1] * ahead + step[0] * aside)
    end = (32 + step[0] * (ahead + 3) + step[1] * aside, 32 + step[1] * (ahead + 3) + step[0] * aside)
    line = tag("path", d=f"M{start[0]:g} {start[1]:g}L{end[0]:g} {end[1]:g}", class_="stroke")
    return join(_tip(start), line, _head(end, (float(step[0]), float(step[1]))))


def _circle(turn: float) -> Markup:
    """Most of a circle from the top; on the screen y grows downward, so a positive angle turns clockwise."""
    radius, begin, extent = 20.0, -pi / 2, turn * 1.5 * pi
    start, end = ((32 + radius * cos(a), 32 + radius * sin(a)) for a in (begin, begin + extent))
    sweep = 1 if turn > 0 else 0
    arc = f"M{start[0]:.1f} {start[1]:.1f}A{radius:g} {radius:g} 0 1 {sweep} {end[0]:.1f} {end[1]:.1f}"
    heading = (-sin(begin + extent) * turn, cos(begin + extent) * turn)
    return join(_tip(start), tag("path", d=arc, class_="stroke"), _head(end, heading))


def _head(end: Point, heading: Point) -> Markup:
    length = hypot(*heading)
    a, b = heading[0] / length, heading[1] / length
    wings = [(end[0] - HEAD * (a * c - b * s), end[1] - HEAD * (a * s + b * c)) for c, s in ((0.8, 0.6), (0.8, -0.6))]
    d = f"M{wings[0][0]:.1f} {wings[0][1]:.1f}L{end[0]:.1f} {end[1]:.1f}L{wings[1][0]:.1f} {wings[1][1]:.1f}"
    return tag("path", d=d, class_="stroke")


def _tip(at: Point) -> Markup:
    return tag("circle", cx=float(at[0]), cy=float(at[1]), r=TIP, class_="tip")
