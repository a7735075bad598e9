"""Tables of figures: printed as Markdown, so that a document can hold what a command has printed."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field

Value = str | int | float


@dataclass(frozen=True, slots=True)
class Table:
    """A table with a head. A float is shown with two significant digits, from 100 to a million as an integer.

    `notes` stand below, as one paragraph.
    """

    title: str
    head: tuple[str, ...]
    rows: list[tuple[Value, ...]] = field(default_factory=list)
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        cells = [[_text(cell) for cell in row] for row in (self.head, *self.rows)]
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        lines = [_line(row, widths) for row in cells]
        rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
        notes = textwrap.fill(" ".join(self.notes), 118)
        return "\n".join([f"### {self.title}", "", lines[0], rule, *lines[1:], "", *([notes, ""] if notes else [])])


def _text(cell: Value) -> str:
    if not isinstance(cell, float):
        return str(cell)
    return f"{cell:.0f}" if 99.5 <= abs(cell) < 1e6 else f"{cell:.2g}"


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    return "| " + " | ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)) + " |"
