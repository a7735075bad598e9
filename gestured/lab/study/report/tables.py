"""The study's tables, the same on the page and in Markdown."""

from collections.abc import Mapping
from typing import Any

from gestured.lab.table import Table

from . import formats, reading
from .formats import number, share, values
from .reading import Row, Study

Line = tuple[str, ...]


def tables(study: Study) -> list[Table]:
    """Those that have rows, each a part of study.json."""
    found = (_right, _copies, _run_time, _sessions, _choices, _methods, _tuning, _calibration, _data, _machine)
    return [table for make in found if (table := make(study)).rows]


def _named(study: Study, row: Row) -> str:
    return str(study["methods"][row["method"]]["title"])


def _right(study: Study) -> Table:
    seeds = study["about"]["seeds"]
    several = f"Mean of {seeds} seeds (splits and training); ± is the standard deviation between them."

    def cell(row: Row | None) -> str:
        return share(row) + (f" ±{row['spread']:.3f}" if row and seeds > 1 else "")

    lines: list[Line] = []
    for (method, settings, augmentation), cells in reading.lines(study):
        published = number(reading.published(study, method, augmentation))
        about = (_named(study, {"method": method}), settings, augmentation, published)
        lines.append((*about, *(cell(cells.get(name)) for name in reading.PROTOCOLS)))
    return Table(
        "Right answers",
        ("method", "settings", "augmentation", "published", *reading.PROTOCOLS.values()),
        [*lines],
        (several if seeds > 1 else "Of one seed (splits and training).", "In brackets 95 % intervals over people."),
    )


def _copies(study: Study) -> Table:
    return Table(
        "What is owed to copies",
        ("method", "settings", "test gestures with their copy in training", "right, those", "right, others",
         "gain by augmentation, paper's protocol", "gain, clean split"),
        [
            (_named(study, row), row["settings"], f"{row['with_copy']} of {row['test']}",
             number(row["right_with_copy"]), number(row["right_without_copy"]),
             number(row["gain_leaky"], "+.2f"), number(row["gain_clean"], "+.2f"))
            for row in study["copies"]
        ],
        ("What is gained under the paper's protocol, which augments before it splits, and not with the clean split is",
         "owed to copies of the test gestures in the training set, unchanged or shifted."),
    )  # fmt: skip


def _run_time(study: Study) -> Table:
    def line(row: Row) -> Line:
        memory, file = row["memory_bytes"], row["file_bytes"]
        return (
            _named(study, row), row["settings"], row["precision"],
            *(f"{share:.3f}" for share in (1 - row["right"], row["wrong"], row["error"])),
            *(f"{row[name]:.0f}" for name in ("cold_us", "median_us", "p95_us")),
            number(memory and memory / 2**20, ".1f"), f"{file / 1024:.0f}", "yes" if row["front"] else "",
        )  # fmt: skip

    return Table(
        "Error against run time",
        ("method", "settings", "precision", "error of the best score", "wrong", "wrong or lost", "cold us", "warm us",
         "p95 us", "MiB", "file KiB", "on the front"),
        [line(row) for row in study["run_time"]],
        ("Judged on people whom nothing has learned from. *Wrong* and *wrong or lost* are of all gestures performed;",
         "the study's methods reject nothing. On the front nothing is both faster and more often right."),
    )  # fmt: skip


def _sessions(study: Study) -> Table:
    played = [(row, kind) for part, kind in (("online", "the study's"), ("online_shipped", "shipped"))
              for row in study[part]]  # fmt: skip
    return Table(
        "Continuous sessions over UDP",
        ("model", "gestures", "right", "published", "wrong", "missed", "false a minute", "latency p50 ms"),
        [
            (f"{_named(study, row)}, {kind}", row["gestures"], share(row),
             *(number(row[name]) for name in ("published", "wrong", "missed", "false_per_minute")),
             number(row["latency_ms"]["p50"], ".0f"))
            for row, kind in played
        ],
        ("The study's models know the ten gestures and nothing else: whatever else is answered is false. Latency is",
         "from the finger's lift to the event."),
    )  # fmt: skip


def _choices(study: Study) -> Table:
    return Table(
        "Choices that the paper leaves open",
        ("choice", "ours", "right with", "effect"),
        [
            (row["choice"], row["ours"], "; ".join(f"{of['value']}: {share(of)}" for of in row["alternatives"]),
             row["effect"])
            for row in study["choices"]
        ],
    )  # fmt: skip


def _methods(study: Study) -> Table:
    def line(of: Mapping[str, Any]) -> Line:
        found = of["hyperparameters"]
        return of["title"], of["family"], of["what"], values(found["paper"]), values(found["tuned"])

    head = ("method", "family", "what it does", "the paper's settings", "tuned")
    return Table("Methods", head, [line(of) for of in study["methods"].values()])


def _tuning(study: Study) -> Table:
    return Table(
        "Hyperparameters that were compared",
        ("method", "values", "right", "spread between folds", "chosen"),
        [
            (_named(study, row), values(one["values"]), number(one["right"]), number(one["spread"], ".3f"),
             "yes" if one["values"] == row["chosen"] else "")
            for row in study["tuning"] for one in row["candidates"]
        ],
        ("Cross-validation on other people, whole participants left out.",),
    )  # fmt: skip


def _calibration(study: Study) -> Table:
    rows = [(_named(study, row), f"{row['error']:.3f}") for row in study["calibration"]]
    return Table("Calibration", ("method", "expected calibration error"), [*rows], ("Participants held out.",))


def _data(study: Study) -> Table:
    found = study["data"]
    of = found["simulated"]
    lines = [(of["name"], f"{of['participants']}", f"{of['cut']} cut out of {of['performed']} performed")]
    if of := found["real"]:
        lines.append((of["name"], f"{of['subjects']}", f"{of['gestures']} cut out"))
    if of := found["foreign"]:
        lines.append((of["name"], f"{of['participants']}", f"{of['cut']} cut out of {of['performed']} performed"))
    return Table("Data", ("recordings", "people", "gestures"), [*lines])


def _machine(study: Study) -> Table:
    return Table("Machine", ("what", "found"), [(name, formats.NONE if of is None else of)
                                                for name, of in study["machine"].items()])  # fmt: skip
