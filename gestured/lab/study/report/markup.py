"""HTML and SVG from Python: every string is escaped unless it was made here."""

import html
import re
from collections.abc import Iterable

NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # what no XML may hold
EMPTY = {"br", "circle", "col", "line", "meta", "path", "rect"}


class Markup(str):
    """Text that is markup already and is not escaped again."""


def escape(text: str) -> Markup:
    """Any text, fit for an element or a quoted attribute."""
    return text if isinstance(text, Markup) else Markup(html.escape(NO_XML.sub("\ufffd", text)))


def join(*parts: str) -> Markup:
    """Pieces one after the other; what is not markup is escaped."""
    return Markup("".join(escape(part) for part in parts))


def between(separator: str, parts: Iterable[str]) -> Markup:
    """Pieces with a separator between them."""
    return Markup(escape(separator).join(escape(part) for part in parts))


def tag(name: str, /, *children: str, **attributes: str | float | None) -> Markup:
    """One element. `class_` gives class, `stroke_width` stroke-width; an attribute that is None is left out."""
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_value(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    return Markup(f"<{name}{written}/>" if name in EMPTY else f"<{name}{written}>{join(*children)}</{name}>")


def svg(width: float, height: float, title: str, description: str, *parts: str, class_: str = "chart") -> Markup:
    """A drawing of its own size in pixels, with the words that stand for it where it cannot be seen."""
    words = [tag("title", title)] + ([tag("desc", description)] if description else [])
    box = f"0 0 {_value(width)} {_value(height)}"
    return tag("svg", *words, *parts, class_=class_, role="img", width=width, height=height, viewBox=box)


def _value(value: str | float) -> str:
    if isinstance(value, str):
        return escape(value)
    return f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)
