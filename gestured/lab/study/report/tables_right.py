"""The tables of who is right how often: the paper's figure beside ours under each protocol."""

from . import formats, marks, reading
from .layout import OWN, SIMULATED, cell, head, row_head, table
from .markup import Markup, join, tag
from .reading import Row, Study
from .tables import published_cell, share_cell


def protocols(study: Study) -> Markup:
    """A table for each augmentation: methods and settings down, protocols across."""
    found = {name: reading.cells(study, augmentation=name) for name in reading.AUGMENTATIONS}
    return join(*(_table(study, name, rows) for name, rows in found.items() if rows))


def own(study: Study) -> Markup:
    """The same for a researcher's own recordings; nothing where there are none."""
    found = {name: reading.cells(study, augmentation=name, data="own") for name in reading.AUGMENTATIONS}
    tables = [_table(study, name, rows, own=True) for name, rows in found.items() if rows]
    return join(tag("h3", "Your own recordings"), *tables) if tables else Markup("")


def _table(study: Study, augmentation: str, rows: list[Row], own: bool = False) -> Markup:
    present = [name for name in reading.PROTOCOLS if any(row["protocol"] == name for row in rows)]
    told, floor = any(row.get("published") is not None for row in rows), reading.floor(study)
    heads = [head("Method"), head("Settings"), *([head("Published")] if told else [])]
    heads += [head(tag("span", name), tag("small", _on(rows, name))) for name in present]
    lines = []
    for method in reading.in_order(study, {row["method"] for row in rows}):
        figure = reading.published(study, method, augmentation) if told else None
        classes = f"f{marks.look_of(study, method).family} v0"
        for settings, words in reading.SETTINGS.items():
            mine = {row["protocol"]: row for row in rows if (row["method"], row["settings"]) == (method, settings)}
            if mine:
                line = [row_head(marks.named(study, method)), cell(words), *([published_cell(figure)] if told else [])]
                lines.append([*line, *(share_cell(mine.get(name), classes, figure, floor) for name in present)])
    name = reading.AUGMENTATIONS[augmentation]
    caption = f"Right in per cent and its 95 % interval over people, drawn from {formats.percent(floor, 0)} to 100"
    caption += "; the stroke is the published figure." if told else "."
    source = OWN if own else "simulated data, but for “real”" if "real" in present else SIMULATED
    return table(name[0].upper() + name[1:], source, caption, heads, lines)


def _on(rows: list[Row], protocol: str) -> str:
    data = {row["data"] for row in rows if row["protocol"] == protocol}
    return " and ".join(sorted(data)) + " data"
