"""matplotlib's drawings as parts of the page: in its colours, in its font, with words for whoever cannot see them."""

import io
import re
import warnings
from collections.abc import Mapping
from contextlib import AbstractContextManager
from importlib.resources import files
from typing import Any, Literal, NamedTuple
from xml.etree import ElementTree

import matplotlib.style
from markupsafe import Markup
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from . import reading

STYLE = str(files(__package__) / "charts.mplstyle")
CSS = (files(__package__) / "style.css").read_text("utf-8")
COLOURS: dict[str, str] = dict(re.findall(r"--(\w+): (#\w{6});", CSS.split("}")[0]))  # of the light page
NAMES = {colour: f"var(--{name})" for name, colour in COLOURS.items()}
INK, SOFT, PAGE, CARD, GRID = (COLOURS[name] for name in ("ink", "soft", "page", "card", "grid"))
# matplotlib's markers, the last one the published figure's, and their sizes in pixels: about the same area.
FORMS: tuple[Any, ...] = ("o", "s", "^", "D", (4, 1, 0), "|")
SIZES = (9.5, 8.4, 10.5, 7.8, 13.0, 14.0)
DASHES: tuple[Any, ...] = ("-", (0, (3, 1.5)), (0, (1, 1.5)), (0, (4.5, 1.5, 1, 1.5)))  # in widths of the line
SVG, LINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"


def styled() -> AbstractContextManager[None]:
    """Where drawings are made and written: in charts.mplstyle, whatever the user's own matplotlib is set to."""
    return matplotlib.style.context(["default", STYLE])


class Mark(NamedTuple):
    """How something looks in every figure. Of a method, form and colour say the family, the filling which one it is."""

    form: int
    colour: str = "ink"
    filling: int = 0  # full, hollow, half, with a dark edge

    @property
    def id(self) -> str:
        """Its name in the page, where it is drawn once and used by name."""
        return f"mark-{self.form}-{self.colour}-{self.filling}"

    @property
    def hue(self) -> str:
        """Its colour on the light page, as #rrggbb."""
        return COLOURS[self.colour]

    @property
    def style(self) -> dict[str, Any]:
        """matplotlib's properties of a line whose points have this mark."""
        bar = {"markeredgewidth": 4.0} if self.form == len(FORMS) - 1 else {}
        return {
            "color": self.hue, "marker": FORMS[self.form], "markersize": SIZES[self.form],
            "markerfacecolor": PAGE if self.filling == 1 else self.hue, "markerfacecoloralt": PAGE,
            "fillstyle": "bottom" if self.filling == 2 else "full",
            "markeredgecolor": INK if self.filling == 3 else self.hue, **bar,
        }  # fmt: skip

    @property
    def dashes(self) -> Any:
        """How matplotlib dashes a line of this mark."""
        return DASHES[self.filling]

    def symbol(self) -> Markup:
        """The mark alone, to be used by its id."""
        drawing = Drawing(16, 16, None)
        drawing.figure.add_artist(Line2D([0.5], [0.5], **self.style))
        return drawing.markup("symbol", self.id, id=self.id)


def mark_of(study: reading.Study, method: str) -> Mark:
    """A method's mark, the same on the whole page."""
    family = reading.family(study, method)
    relatives = [name for name in study.get("methods") or {} if reading.family(study, name) == family]
    return Mark(family, f"f{family}", relatives.index(method) % len(DASHES) if method in relatives else 3)


def families(study: reading.Study, rows: list[reading.Row]) -> list[tuple[Mark, str]]:
    """The families of some methods, each with the mark of its first one."""
    return [(Mark(k, f"f{k}"), reading.FAMILIES[k]) for k in sorted({reading.family(study, r["method"]) for r in rows})]


class Drawing:
    """A figure of its own size in pixels, and what its parts say when the pointer rests on them."""

    def __init__(self, width: float, height: float, layout: Literal["constrained"] | None = "constrained") -> None:
        self.figure = Figure(figsize=(width / 72, height / 72), layout=layout)
        self.width, self.height = width, height
        self._told: dict[str, str] = {}

    def tell(self, artist: Artist, words: str) -> None:
        """Say `words` when the pointer rests on `artist`."""
        artist.set_gid(f"told-{len(self._told)}")
        self._told[str(artist.get_gid())] = words

    def point(self, axes: Axes, x: float, y: float, mark: Mark, words: str, **more: Any) -> None:
        """One mark, above all lines, that may reach over the edge of its axes."""
        self.tell(axes.plot([x], [y], clip_on=False, zorder=3, **mark.style | {"linestyle": ""} | more)[0], words)

    def svg(self, title: str, description: str = "") -> Markup:
        """The drawing with the words that stand for it where it cannot be seen."""
        size = {"width": f"{self.width:g}", "height": f"{self.height:g}"}
        words = {name: said for name, said in (("desc", description), ("title", title)) if said}
        return self.markup("svg", title, words, **size, **{"class": "chart", "role": "img"})

    def alone(self, title: str) -> str:
        """The drawing as a file of its own, with the colours of the light page and on its ground."""
        self.figure.set_facecolor(PAGE)
        written = re.sub(r"var\(--(\w+)\)", lambda found: COLOURS[found[1]], self.svg(title))
        return written.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1) + "\n"

    def markup(self, tag: str, salt: str, words: Mapping[str, str] | None = None, /, **attributes: str) -> Markup:
        """What matplotlib writes, as an element of the page.

        Groups lose their ids, which are the same in every drawing; the other ids are made unique by the salt.
        """
        written = io.StringIO()
        matplotlib.rcParams["svg.hashsalt"] = salt
        with warnings.catch_warnings():  # the reader's fonts write the words, not matplotlib's
            warnings.filterwarnings("ignore", "Glyph .* missing")
            self.figure.savefig(written, format="svg", metadata={"Date": None})
        root = ElementTree.fromstring(written.getvalue())
        root.tag, root.attrib = tag, {**attributes, "viewBox": root.attrib["viewBox"]}
        for element in list(root.iter()):
            for child in list(element):
                if child.tag in (f"{SVG}style", f"{SVG}metadata"):
                    element.remove(child)
            self._adopt(element)
        for name, said in (words or {}).items():
            _first(root, name, said)
        return Markup(ElementTree.tostring(root, encoding="unicode"))

    def _adopt(self, element: ElementTree.Element) -> None:
        element.tag, element.tail = element.tag.removeprefix(SVG), None
        if element.tag != "text":
            element.text = None
        if element.tag == "g":
            words = self._told.get(element.attrib.pop("id", ""))
            if words is not None:
                _first(element, "title", words)
        if "style" in element.attrib:
            style = element.attrib["style"].replace("'DejaVu Sans'", "sans-serif")
            element.attrib["style"] = re.sub("#[0-9a-f]{6}", lambda found: NAMES.get(found[0], found[0]), style)
        if LINK in element.attrib:
            element.attrib["href"] = element.attrib.pop(LINK)


def _first(parent: ElementTree.Element, tag: str, words: str) -> None:
    child = ElementTree.Element(tag)
    child.text = words
    parent.insert(0, child)
