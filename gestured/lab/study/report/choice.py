"""The table below the picture: the models that ship, and who takes which."""

from . import formats, reading
from .reading import Row, Study

FIELDS = ("simulated", "foreign", "real")


CHOICES = {  # method -> who takes the model of it that ships
    "cnn_lstm": "you have no reason to take another: `gestured` runs it unless told otherwise",
    "lstm": "the first cannot be used; it is its fallback",
    "tp_rf": "neither network can be used; it mostly says `unknown`, so that it is seldom wrong",
}
HEAD = (
    "| take | if | % wrong: simulated, another generator, real | % wrong or lost (95 % over people) "
    "| a decision, cold | false events a minute |",
    "|---|---|---|---|---|---|",
)


def table(study: Study) -> list[str]:
    """Lines of Markdown; a model that was not timed is left out."""
    rows = {row["method"]: row for row in study["run_time"] if row["settings"] == "shipped"}
    return [*HEAD, *(_line(study, rows[one], when) for one, when in CHOICES.items() if one in rows)]


def _line(study: Study, row: Row, when: str) -> str:
    played = {of["method"]: of for of in study["online_shipped"]}
    fields = [row["fields"].get(field, {}) for field in FIELDS]
    wrong = ", ".join(formats.percent(of.get("wrong")) for of in fields)
    error = ", ".join(_with_interval(of) for of in fields)
    cells = (
        reading.title(study, row["method"]), when, wrong, error, formats.duration(row["cold_us"]),
        formats.number(played.get(row["method"], {}).get("false_per_minute"), ".4g"),
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _with_interval(of: Row) -> str:
    """A field's error, and its interval where it has one."""
    ends = formats.interval({end: of.get(f"error_{end}") for end in ("low", "high")})
    return formats.percent(of.get("error")) + (f" ({ends})" if ends else "")
