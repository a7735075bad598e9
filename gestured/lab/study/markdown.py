"""The key tables of a study as Markdown, for documents that quote them."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

Row = Mapping[str, Any]
PROTOCOLS = ("paper", "clean", "participants", "real")


def tables(study: Mapping[str, Any]) -> str:
    """Right answers under each protocol, copies, run time, sessions and open choices of a study.json."""
    parts = [
        _command(study),
        ("## Right answers", _cells(study)),
        ("## What is owed to copies", _copies(study)),
        ("## Error against run time", _run_time(study)),
        ("## Continuous sessions over UDP", _online(study)),
        ("## Choices that the paper leaves open", _choices(study)),
    ]
    return "\n\n".join(part if isinstance(part, str) else f"{part[0]}\n\n{part[1]}" for part in parts) + "\n"


def _command(study: Mapping[str, Any]) -> str:
    machine, data = study["machine"], study["data"]["simulated"]
    return (
        f"`gestured-lab study` on {machine['date']}, {machine['cpu']}, {machine['cores']} cores, "
        f"{machine['minutes']} minutes. Simulated: {data['name']}, {data['participants']} participants, "
        f"{data['performed']} gestures performed, {data['cut']} cut out by the front end."
    )


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _share(row: Row | None) -> str:
    if row is None or row.get("right") is None:
        return "-"
    text = f"{row['right']:.2f}"
    return text if row.get("low") is None else f"{text} ({row['low']:.2f}-{row['high']:.2f})"


def _number(value: float | None, form: str = ".2f") -> str:
    return "-" if value is None else format(value, form)


def _title(study: Mapping[str, Any], row: Row) -> str:
    return str(study["methods"][row["method"]]["title"])


def _cells(study: Mapping[str, Any]) -> str:
    found: dict[tuple[str, str, str], dict[str, Row]] = {}
    for row in study["cells"]:
        place = found.setdefault((row["method"], row["settings"], row["augmentation"]), {})
        if row["data"] in ("simulated", "real"):
            place[row["protocol"]] = row
    rows = []
    for (_, settings, augmentation), cells in found.items():
        one = next(iter(cells.values()))
        published = next((c["published"] for c in cells.values() if c.get("published") is not None), None)
        rows.append(
            [_title(study, one), settings, augmentation, _number(published), *(_share(cells.get(p)) for p in PROTOCOLS)]
        )
    heads = ("paper's protocol", "clean split", "participants held out", "real, subjects held out")
    return _table(["method", "settings", "augmentation", "published", *heads], rows)


def _copies(study: Mapping[str, Any]) -> str:
    rows = [
        [
            _title(study, row), row["settings"], f"{row['with_copy']} of {row['test']}",
            _number(row["right_with_copy"]),
            _number(row["right_without_copy"]), _number(row["gain_leaky"], "+.2f"), _number(row["gain_clean"], "+.2f"),
        ]
        for row in study["copies"]
    ]  # fmt: skip
    head = ["method", "settings", "test gestures with their copy in training", "right, those", "right, others"]
    return _table([*head, "gain by augmentation, paper's protocol", "gain, clean split"], rows)


def _run_time(study: Mapping[str, Any]) -> str:
    rows = [
        [
            _title(study, row), row["settings"], row["precision"], _number(1 - row["right"], ".3f"),
            _number(row["median_us"], ".0f"), _number(row["p95_us"], ".0f"),
            _number(None if row["memory_bytes"] is None else row["memory_bytes"] / 2**20, ".1f"),
            _number(None if row["file_bytes"] is None else row["file_bytes"] / 1024, ".0f"),
            "yes" if row["front"] else "",
        ]
        for row in study["run_time"]
    ]  # fmt: skip
    head = ["method", "settings", "precision", "error", "median us", "p95 us", "MiB", "file KiB", "on the front"]
    return _table(head, rows)


def _online(study: Mapping[str, Any]) -> str:
    rows = [
        [
            name, str(row["gestures"]), _share(row), _number(row.get("published")), _number(row["wrong"]),
            _number(row["missed"]), _number(row["false_per_minute"]), _number(row["latency_ms"]["p50"], ".0f"),
        ]
        for key, kind in (("online", "the study's"), ("online_shipped", "shipped"))
        for row in study.get(key) or []
        for name in [f"{_title(study, row) if row['method'] in study['methods'] else row['method']}, {kind}"]
    ]  # fmt: skip
    head = ["model", "gestures", "right", "published", "wrong", "missed", "false a minute", "latency p50 ms"]
    return _table(head, rows)


def _choices(study: Mapping[str, Any]) -> str:
    rows = [
        [
            row["choice"], row["ours"],
            "; ".join(f"{a['value']}: {_share(a)}" for a in row["alternatives"]), row["effect"],
        ]
        for row in study["choices"]
    ]  # fmt: skip
    return _table(["choice", "ours", "right with", "effect"], rows)
