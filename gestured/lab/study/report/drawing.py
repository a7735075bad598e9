"""The look of the study's figures: marks for methods, and matplotlib's style."""

import io
from contextlib import AbstractContextManager
from importlib.resources import files
from typing import Any, NamedTuple

import matplotlib.style
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from . import reading

STYLE = str(files(__package__) / "charts.mplstyle")
# Those of Okabe and Ito, deepened until they stand out from the page; f0 and so on are families of methods.
COLOURS = {
    "page": "#fdfcf9", "ink": "#1c2024", "soft": "#57606a", "grid": "#e6e3dc",
    "f0": "#0067a5", "f1": "#b9480a", "f2": "#96498a", "f3": "#007a5a", "f4": "#7d6500",
}  # fmt: skip
INK, SOFT, PAGE, GRID = (COLOURS[name] for name in ("ink", "soft", "page", "grid"))
# matplotlib's markers, and their sizes in pixels: about the same area.
FORMS: tuple[Any, ...] = ("o", "s", "^", "D", (4, 1, 0))
SIZES = (9.5, 8.4, 10.5, 7.8, 13.0)
FILLINGS = 4  # full, hollow, half, with a dark edge


def styled() -> AbstractContextManager[None]:
    """Where figures are made and written: in charts.mplstyle, whatever the user's own matplotlib is set to."""
    return matplotlib.style.context(["default", STYLE])


def sheet(width: float, height: float) -> Figure:
    """A figure of so many pixels."""
    return Figure(figsize=(width / 72, height / 72), layout="constrained")


def svg(figure: Figure, title: str) -> str:
    """The figure as a file of its own, which is the same each time it is drawn."""
    written = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": title}):
        figure.savefig(written, format="svg", metadata={"Date": None, "Creator": None, "Title": title})
    return written.getvalue()


class Mark(NamedTuple):
    """How something looks in every figure. Of a method, form and colour say the family, the filling which one it is."""

    form: int
    colour: str = "ink"
    filling: int = 0

    @property
    def hue(self) -> str:
        """Its colour, as #rrggbb."""
        return COLOURS[self.colour]

    @property
    def style(self) -> dict[str, Any]:
        """matplotlib's properties of points with this mark."""
        return {
            "color": self.hue, "marker": FORMS[self.form], "markersize": SIZES[self.form], "linestyle": "",
            "markerfacecolor": PAGE if self.filling == 1 else self.hue, "markerfacecoloralt": PAGE,
            "fillstyle": "bottom" if self.filling == 2 else "full",
            "markeredgecolor": INK if self.filling == 3 else self.hue,
        }  # fmt: skip

    def point(self, axes: Axes, x: float, y: float) -> None:
        """Draw it once, above all lines; it may reach over the edge of its axes."""
        axes.plot([x], [y], clip_on=False, zorder=3, **self.style)


def mark_of(study: reading.Study, method: str) -> Mark:
    """A method's mark, the same in all figures."""
    family = reading.family(study, method)
    relatives = [name for name in study["methods"] if reading.family(study, name) == family]
    return Mark(family, f"f{family}", relatives.index(method) % FILLINGS)


def families(study: reading.Study, rows: list[reading.Row]) -> list[tuple[Mark, str]]:
    """The families of some methods, each with the mark of its first one."""
    return [(Mark(k, f"f{k}"), reading.FAMILIES[k]) for k in sorted({reading.family(study, r["method"]) for r in rows})]
