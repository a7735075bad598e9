"""The table below the picture: five models of those that are drawn, and who takes which."""

from . import formats, reading
from .reading import Row, Study

FIELDS = ("simulated", "foreign", "real")


CHOICES = {  # (method, settings) -> who takes it
    ("cnn_lstm", "shipped"): "you have no reason to take another: `gestured` runs it unless told otherwise",
    ("lstm", "shipped"): "the first cannot be used; it is its fallback",
    ("tp_rf", "shipped"): "neither network can be used; it mostly says `unknown`, so that it is seldom wrong",
    ("trajectory_gb", "tuned"): "you train your own, and nothing but the ten gestures is ever done: it rejects nothing",
    ("cnn_gru", "tuned"): "the same, and a decision must take a third of the time",
}
HEAD = (
    "| take | if | % wrong: simulated, another generator, real | % wrong or lost (95 % over people) "
    "| a decision, cold | memory | false events a minute |",
    "|---|---|---|---|---|---|---|",
)


def table(study: Study) -> list[str]:
    """Lines of Markdown; a model that was not timed is left out."""
    rows = {(row["method"], row["settings"]): row for row in study["run_time"]}
    return [*HEAD, *(_line(study, rows[one], when) for one, when in CHOICES.items() if one in rows)]


def _line(study: Study, row: Row, when: str) -> str:
    ships = row["settings"] == "shipped"
    played = {of["method"]: of for of in study["online_shipped" if ships else "online"]}
    fields = [row["fields"].get(field, {}) for field in FIELDS]
    wrong = ", ".join(formats.percent(of.get("wrong")) for of in fields)
    error = ", ".join(_with_interval(of) for of in fields)
    name = f"{reading.title(study, row['method'])}{', ships' if ships else ''}"
    memory = row["memory_bytes"]
    cells = (
        name, when, wrong, error, formats.duration(row["cold_us"]),
        formats.NONE if memory is None else f"{memory / 2**20:.0f} MiB",
        formats.number(played.get(row["method"], {}).get("false_per_minute"), ".4g"),
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _with_interval(of: Row) -> str:
    """A field's error, and its interval where it has one."""
    ends = formats.interval({end: of.get(f"error_{end}") for end in ("low", "high")})
    return formats.percent(of.get("error")) + (f" ({ends})" if ends else "")
