"""The tables of what was measured besides: copies, run time, online sessions; and the cells that tables share."""

from . import formats, marks, reading
from .layout import SIMULATED, cell, heads, row_head, table
from .markup import Markup, join, tag
from .reading import Row, Study
from .summary import from_copies


def share_cell(row: Row | None, classes: str, published: float | None = None, low: float = 0.0) -> Markup:
    """A share in per cent with its interval, in figures and drawn from `low` to 1."""
    if row is None:
        return cell(formats.NONE, class_="none")
    words = join(
        tag("span", formats.percent(row["right"]), class_="share"),
        " ",
        tag("span", formats.interval(row), class_="interval"),
    )
    return cell(words, marks.dot(row, classes, published, low), value=row["right"], class_="right")


def published_cell(share: float | None) -> Markup:
    return cell(formats.percent(share, 0), value=-1.0 if share is None else share)


def copies(study: Study) -> Markup:
    """How much of the gain from augmentation comes from copies of test gestures."""
    rows = reading.part(study, "copies")
    moved = any(row.get("with_version") is not None for row in rows)
    names = [
        "Method",
        "Settings",
        "Test gestures",
        "In training, unchanged",
        *(["In training, shifted"] if moved else []),
    ]
    names += ["Right, if unchanged", "Right, if not", "Gain, augmented before", "Gain, after", "From copies, %"]
    most = max((row["gain_leaky"] or 0.0 for row in rows), default=0.0)
    lines = [
        [
            row_head(marks.named(study, row["method"])),
            cell(reading.SETTINGS[row["settings"]]),
            cell(formats.count(row["test"]), value=row["test"]),
            *(_of(row.get(name), row["test"]) for name in ("with_copy", *(["with_version"] if moved else []))),
            *(_share(row[name]) for name in ("right_with_copy", "right_without_copy")),
            *(_points(row[name]) for name in ("gain_leaky", "gain_clean")),
            _share(from_copies(row)),
            cell(marks.gain(row["gain_leaky"], row["gain_clean"], most)),
        ]
        for row in rows
    ]
    return table(
        "How much of the gain from augmentation is copies",
        SIMULATED,
        "Shares in per cent, gains in percentage points against no augmentation. “Before” augments before the split, "
        "as the published figures suggest; “after” only the training part. What is gained before but not after is "
        "owed to copies of the test gestures in the training set, unchanged or shifted: the pale part of the bar.",
        heads(*names, "Gain, drawn"),
        lines,
    )


def _of(some: int | None, all_: int) -> Markup:
    share = f" ({formats.with_unit(some / all_, 0)})" if some is not None and all_ else ""
    return cell(formats.count(some) + share, value=some)


def _share(share: float | None) -> Markup:
    return cell(formats.percent(share), value=-1.0 if share is None else share)


def _points(gain: float | None) -> Markup:
    return cell(formats.NONE if gain is None else formats.points(gain), value=gain)


def run_time(study: Study) -> Markup:
    names = [
        "Method",
        "Settings",
        "Precision",
        "Right, %",
        "Median",
        "95th percentile",
        "Memory",
        "File",
        "On the front",
    ]
    lines = []
    for row in sorted(reading.part(study, "run_time"), key=lambda row: row["median_us"]):
        look = marks.look_of(study, row["method"])
        lines.append(
            [
                row_head(marks.named(study, row["method"])),
                cell(reading.SETTINGS[row["settings"]]),
                cell(row["precision"]),
                share_cell(row, f"f{look.family} v0"),
                *(cell(formats.duration(row[name]), value=row[name]) for name in ("median_us", "p95_us")),
                *(cell(formats.size(row[name]), value=row[name]) for name in ("memory_bytes", "file_bytes")),
                cell("yes" if row["front"] else "", value=float(row["front"])),
            ]
        )
    return table(
        "Run time, memory and size", SIMULATED, "The same points in figures, fastest first.", heads(*names), lines
    )


def online(study: Study) -> Markup:
    """The sessions with the study's own models, and with the shipped ones where they were played to them too."""
    caption = "Continuous sessions over UDP to a running daemon. Latency is from the finger's lift to the event. "
    ours = "The study's models know the ten gestures and nothing else: whatever else is answered counts as extra."
    tables = [_sessions(study, "online", "The study's models", caption + ours)]
    if reading.part(study, "online_shipped"):
        words = "The same sessions with the models that ship with gestured, which reject what they do not know."
        tables.append(_sessions(study, "online_shipped", "The shipped models", words))
    return join(*tables)


def _sessions(study: Study, part: str, title: str, caption: str) -> Markup:
    names = ["Method", "Gestures", "Published", "Right, %", "Wrong, %", "Missed, %", "Extra, %"]
    names += ["False a minute", "Latency, median", "95th percentile"]
    lines = []
    for row in reading.part(study, part):
        look, latency = marks.look_of(study, row["method"]), row.get("latency_ms") or {}
        lines.append(
            [
                row_head(marks.named(study, row["method"])),
                cell(formats.count(row["gestures"]), value=row["gestures"]),
                published_cell(row.get("published")),
                share_cell(row, f"f{look.family} v0", row.get("published")),
                *(_share(row[name]) for name in ("wrong", "missed", "extra")),
                cell(f"{row['false_per_minute']:.2f}", value=row["false_per_minute"]),
                *(_milliseconds(latency.get(name)) for name in ("p50", "p95")),
            ]
        )
    return table(title, SIMULATED, caption, heads(*names), lines)


def _milliseconds(value: float | None) -> Markup:
    return cell(formats.NONE if value is None else f"{value:.0f}{formats.THIN}ms", value=value)
