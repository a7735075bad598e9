"""How a method looks in every figure: colour and form say the family, filling and dashes the method within it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from . import formats, reading
from .chart import Scale
from .markup import Markup, svg, tag

WIDTH, HEIGHT = 118, 14  # of an interval in a table's cell
FORMS = {  # around (0, 0), of about the same area
    "square": "M-4.2-4.2H4.2V4.2H-4.2Z",
    "triangle": "M0-5.6L5.4 4H-5.4Z",
    "diamond": "M0-6L6 0L0 6L-6 0Z",
    "star": "M0-6L1.8-1.8L6 0L1.8 1.8L0 6L-1.8 1.8L-6 0L-1.8-1.8Z",
    "bar": "M-2-7H2V7H-2Z",
    "circle": "M-4.8 0A4.8 4.8 0 1 1 4.8 0A4.8 4.8 0 1 1-4.8 0Z",
}
FAMILY_FORMS = ("circle", "square", "triangle", "diamond", "star")


@dataclass(frozen=True)
class Look:
    """Classes of style.css: `f0` to `f4` are colours, `v0` to `v3` fillings and dashes."""

    family: int
    variant: int

    @property
    def classes(self) -> str:
        return f"f{self.family} v{self.variant % 4}"


def looks(study: reading.Study) -> dict[str, Look]:
    """Each method's look, the same on the whole page."""
    seen: dict[int, int] = {}
    found = {}
    for method in study.get("methods") or {}:
        family = reading.family(study, method)
        found[method] = Look(family, seen.get(family, 0))
        seen[family] = seen.get(family, 0) + 1
    return found


def look_of(study: reading.Study, method: str) -> Look:
    return looks(study).get(method, Look(len(reading.FAMILIES) - 1, 3))


def form(name: str, x: float, y: float, classes: str, title: str = "") -> Markup:
    """A mark of one of FORMS; the title shows when the pointer rests on it."""
    drawn = tag("path", d=FORMS[name], class_=f"mark {classes}", transform=f"translate({x:.1f} {y:.1f})")
    return tag("g", tag("title", title), drawn) if title else drawn


def marker(look: Look, x: float, y: float, title: str = "", more: str = "") -> Markup:
    return form(FAMILY_FORMS[look.family], x, y, f"{look.classes} {more}".strip(), title)


def whisker(x1: float, y1: float, x2: float, y2: float, classes: str) -> Markup:
    return tag("line", x1=float(x1), y1=float(y1), x2=float(x2), y2=float(y2), class_=f"whisker {classes}")


def key(study: reading.Study, methods: Sequence[str]) -> Markup:
    """The legend of a figure: each method with its mark."""
    return _legend([(_small(look_of(study, m)), reading.title(study, m)) for m in methods])


def family_key(study: reading.Study, methods: Sequence[str]) -> Markup:
    present = sorted({look_of(study, method).family for method in methods})
    return _legend([(_small(Look(k, 0)), reading.FAMILIES[k]) for k in present])


def form_key(entries: Sequence[tuple[str, str, str]]) -> Markup:
    """(form, classes, words) of marks that are no method's."""
    return _legend([(_swatch(form(name, 8, 8, classes), words), words) for name, classes, words in entries])


def _small(look: Look) -> Markup:
    return _swatch(marker(look, 8, 8), reading.FAMILIES[look.family])


def swatch(study: reading.Study, method: str) -> Markup:
    """A method's mark, to stand before its name."""
    return _small(look_of(study, method))


def _swatch(mark: Markup, words: str) -> Markup:
    return svg(16, 16, words, "", mark, class_="swatch")


def _legend(entries: Sequence[tuple[Markup, str]]) -> Markup:
    return tag("ul", *(tag("li", picture, " ", words) for picture, words in entries), class_="legend")


def dot(row: dict[str, Any], classes: str = "f0 v0", published: float | None = None, low: float = 0.0) -> Markup:
    """A share with its interval and the published figure as a stroke, from `low` to 100 %, for a table's cell."""
    place = Scale(low, 1.0, 6.0, WIDTH - 6.0)
    middle = HEIGHT / 2
    words = formats.with_unit(row["right"])
    parts = [tag("line", x1=6, x2=WIDTH - 6, y1=middle, y2=middle, class_="grid")]
    if row.get("low") is not None and row.get("high") is not None:
        words += f", 95 % interval {formats.interval(row)}"
        parts.append(whisker(place(row["low"]), middle, place(row["high"]), middle, classes))
    if published is not None:
        words += f"; published {formats.with_unit(published)}"
        x = place(published)
        parts.append(tag("line", x1=x, x2=x, y1=1, y2=HEIGHT - 1, class_="published"))
    parts.append(tag("circle", cx=place(row["right"]), cy=middle, r=2.8, class_=f"dot {classes}"))
    return svg(WIDTH, HEIGHT, words, "", *parts, class_="inline")


def gain(before: float | None, after: float | None, most: float) -> Markup:
    """A bar as long as the gain with copies, on a scale up to `most`; filled as far as what is left without them."""
    place = Scale(0.0, most or 1.0, 0.0, WIDTH)
    long, short = (place(max(0.0, value or 0.0)) for value in (before, after))
    bars = [tag("rect", x=0, y=2, width=long, height=10, class_="owed")]
    bars.append(tag("rect", x=0, y=2, width=min(long, short), height=10, class_="kept"))
    title = f"gain {formats.points(before or 0.0)} points, {formats.points(after or 0.0)} without copies"
    return svg(WIDTH, HEIGHT, title, "", *bars, class_="inline")


def named(study: reading.Study, method: str) -> Markup:
    """A method's mark and name, for the head of a row."""
    return tag("span", swatch(study, method), tag("span", reading.title(study, method)), class_="named")
