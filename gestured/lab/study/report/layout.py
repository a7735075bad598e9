"""What the page is built of: sections, figures and tables with their captions."""

from collections.abc import Sequence
from dataclasses import dataclass

from .markup import Markup, join, tag

SIMULATED, REAL, OWN = "simulated data", "real recordings", "your own recordings"


@dataclass(frozen=True)
class Section:
    """A part of the page: its address on it, its heading, and what stands below."""

    name: str
    title: str
    body: Markup

    def markup(self) -> Markup:
        return tag("section", tag("h2", self.title), self.body, id=self.name)


def paragraph(*words: str, class_: str | None = None) -> Markup:
    return tag("p", *words, class_=class_)


def absent(what: str) -> Markup:
    """A part that was not computed, said in a sentence."""
    return paragraph(f"{what} not computed in this run.", class_="absent")


def figure(title: str, source: str, caption: str, *content: str, wide: bool = True) -> Markup:
    """A figure below its caption. `source` says on what data; a wide one scrolls in a box of its own."""
    body = scrolling(title, *content) if wide else join(*content)
    return tag("figure", tag("figcaption", *_caption(title, source, caption)), body)


def small(title: str, source: str, caption: str, drawing: Markup) -> Markup:
    """One of several figures of a kind, side by side in a `class="multiples"`."""
    return tag("figure", tag("figcaption", *_caption(title, source, caption)), drawing)


def scrolling(title: str, *content: str) -> Markup:
    return tag("div", *content, class_="scroll", tabindex="0", role="region", aria_label=title)


def head(*words: str) -> Markup:
    return tag("th", *words, scope="col")


def heads(*names: str) -> list[Markup]:
    return [head(name) for name in names]


def row_head(*words: str) -> Markup:
    return tag("th", *words, scope="row")


def cell(*words: str, value: float | None = None, class_: str | None = None) -> Markup:
    """A cell; `value` is what the table is sorted by."""
    return tag("td", *words, data_value=None if value is None else repr(float(value)), class_=class_)


def table(title: str, source: str, caption: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Markup:
    """A table in a box that scrolls; what stands in it is made by `head`, `row_head` and `cell`."""
    top = tag("thead", tag("tr", *columns))
    body = tag("tbody", *(tag("tr", *row) for row in rows))
    words = tag("caption", tag("div", *_caption(title, source, caption)))
    return tag("div", tag("table", words, top, body), class_="scroll", tabindex="0", role="region", aria_label=title)


def folded(summary: str, *content: str) -> Markup:
    return tag("details", tag("summary", summary), *content)


def _caption(title: str, source: str, caption: str) -> list[Markup]:
    parts = [tag("strong", title)]
    if source:
        parts.append(join(" ", tag("span", source, class_="source real" if source == REAL else "source")))
    if caption:
        parts.append(join(" ", tag("span", caption, class_="words")))
    return parts
