"""The look of the lab's figures: matplotlib's style, and how a figure is written."""

import io
from contextlib import AbstractContextManager
from importlib.resources import files

import matplotlib.style
from matplotlib.figure import Figure

STYLE = str(files(__package__) / "charts.mplstyle")
INK, SOFT = "#1c2024", "#57606a"  # colours of what ships and of all else


def styled() -> AbstractContextManager[None]:
    """A context in which figures are made and written in charts.mplstyle, whatever a user's matplotlib is set to."""
    return matplotlib.style.context(["default", STYLE])


def sheet(width: float, height: float) -> Figure:
    """A figure of `width` x `height` pixels."""
    return Figure(figsize=(width / 72, height / 72), layout="constrained")


def svg(figure: Figure, title: str) -> str:
    """The figure as the text of an SVG file, which is the same each time."""
    written = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": title}):
        figure.savefig(written, format="svg", metadata={"Date": None, "Creator": None, "Title": title})
    return written.getvalue()
