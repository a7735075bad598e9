"""Axes, scales, ticks and the plain marks of a chart."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from .markup import Markup, svg, tag

Point = tuple[float, float]


@dataclass(frozen=True)
class Scale:
    """Data from `low` to `high` onto pixels from `start` to `end`."""

    low: float
    high: float
    start: float
    end: float
    log: bool = False

    def __call__(self, value: float) -> float:
        low, high, value = (self._line(v) for v in (self.low, self.high, value))
        return self.start + (value - low) / ((high - low) or 1.0) * (self.end - self.start)

    def _line(self, value: float) -> float:
        return math.log10(max(value, 1e-12)) if self.log else value

    def ticks(self, count: int = 5) -> list[float]:
        """Round values within the scale: powers of ten with 2 and 5 between them where there is room, or steps."""
        if self.log:
            decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            leads = (1, 2, 5) if self.high < 500 * self.low else (1,)
            values = [lead * 10.0**power for power in decades for lead in leads]
        else:
            step = step_of(self.high - self.low, count)
            values = [
                step * k for k in range(math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9) + 1)
            ]
        return [value for value in values if self.low * (1 - 1e-9) <= value <= self.high * (1 + 1e-9)]


def step_of(span: float, count: int) -> float:
    """1, 2 or 5 times a power of ten, so that `count` steps cover about the span."""
    raw = max(span, 1e-9) / count
    power = 10.0 ** math.floor(math.log10(raw))
    return next((lead * power for lead in (1, 2, 5) if lead * power >= raw * 0.999), 10 * power)


def text(x: float, y: float, words: str, anchor: str = "start", class_: str | None = None) -> Markup:
    return tag("text", words, x=float(x), y=float(y), text_anchor=None if anchor == "start" else anchor, class_=class_)


def polyline(points: Sequence[Point], class_: str) -> Markup:
    return tag("path", d="M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points), class_=class_)


@dataclass
class Plot:
    """A chart under construction: two scales, and what has been drawn so far."""

    width: float
    height: float
    x: Scale
    y: Scale
    parts: list[Markup] = field(default_factory=list)

    def add(self, *parts: Markup) -> None:
        self.parts.extend(parts)

    def x_axis(
        self, ticks: Sequence[float], write: Callable[[float], str], label: str = "", grid: bool = False
    ) -> None:
        bottom, top = max(self.y.start, self.y.end), min(self.y.start, self.y.end)
        self.add(tag("line", x1=self.x.start, x2=self.x.end, y1=bottom, y2=bottom, class_="axis"))
        for value in ticks:
            x = self.x(value)
            self.add(
                tag("line", x1=x, x2=x, y1=top if grid else bottom, y2=bottom + 4, class_="grid" if grid else "axis")
            )
            self.add(text(x, bottom + 17, write(value), "middle", "tick"))
        if label:
            self.add(text((self.x.start + self.x.end) / 2, bottom + 36, label, "middle", "label"))

    def y_axis(self, ticks: Sequence[float], write: Callable[[float], str], label: str = "") -> None:
        for value in ticks:
            y = self.y(value)
            self.add(tag("line", x1=self.x.start, x2=self.x.end, y1=y, y2=y, class_="grid"))
            self.add(text(self.x.start - 8, y + 4, write(value), "end", "tick"))
        if label:  # above the axis, horizontally: it is read without turning the head
            self.add(text(self.x.start - 8, min(self.y.start, self.y.end) - 12, label, "start", "label"))

    def at(self, points: Sequence[Point]) -> list[Point]:
        return [(self.x(x), self.y(y)) for x, y in points]

    def line(self, points: Sequence[Point], class_: str) -> None:
        self.add(polyline(self.at(points), class_))

    def band(self, x: Sequence[float], low: Sequence[float], high: Sequence[float], class_: str) -> None:
        """The area between two curves: an interval."""
        around = [*zip(x, high, strict=True), *reversed(list(zip(x, low, strict=True)))]
        self.add(tag("path", d="M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in self.at(around)) + "Z", class_=class_))

    def svg(self, title: str, description: str) -> Markup:
        return svg(self.width, self.height, title, description, *self.parts)
