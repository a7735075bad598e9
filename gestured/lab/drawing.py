"""The look of the laboratory's figures: matplotlib's style, and how a figure is written."""

import io
from contextlib import AbstractContextManager
from importlib.resources import files

import matplotlib.style
from matplotlib.figure import Figure

STYLE = str(files(__package__) / "charts.mplstyle")
INK, SOFT = "#1c2024", "#57606a"  # of what ships, and of all else


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
