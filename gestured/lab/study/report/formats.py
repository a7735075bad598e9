"""How numbers are written: one way for each kind."""

from collections.abc import Sequence
from typing import Any

from .markup import Markup, between, join, tag

NONE = "–"
THIN = "\u202f"  # a narrow space that does not break


def percent(share: float | None, digits: int = 1) -> str:
    """0.8321 -> 83.2; the unit stands in the heading or in the sentence."""
    return NONE if share is None else f"{100 * share:.{digits}f}"


def with_unit(share: float | None, digits: int = 1) -> str:
    return NONE if share is None else f"{percent(share, digits)}{THIN}%"


def points(difference: float) -> str:
    """A difference of two shares, in percentage points with its sign."""
    return f"{100 * difference:+.1f}".replace("-", "\u2212")


def interval(row: dict[str, Any]) -> str:
    low, high = row.get("low"), row.get("high")
    return "" if low is None or high is None else f"{percent(low)}–{percent(high)}"


def duration(microseconds: float | None) -> str:
    if microseconds is None:
        return NONE
    for unit in ("µs", "ms"):
        if microseconds < 999.5:
            return f"{microseconds:.3g}{THIN}{unit}"
        microseconds /= 1000
    return f"{microseconds:.3g}{THIN}s"


def size(count: float | None) -> str:
    """A number of bytes."""
    if count is None:
        return NONE
    for unit in ("B", "KiB", "MiB"):
        if count < 999.5:
            return f"{count:.3g}{THIN}{unit}"
        count /= 1024
    return f"{count:.3g}{THIN}GiB"


def count(number: int | None) -> str:
    return NONE if number is None else f"{number:,}".replace(",", THIN)


def number(value: Any) -> str:
    """A value of a hyperparameter."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def values(mapping: dict[str, Any] | None) -> Markup:
    """Hyperparameters: name and value, each kept together."""
    parts = [tag("span", f"{name} = {number(value)}", class_="value") for name, value in (mapping or {}).items()]
    return between(", ", parts) if parts else Markup(NONE)


def listed(names: Sequence[str]) -> Markup:
    """a, b and c."""
    return between(" and ", [between(", ", names[:-1]), names[-1]]) if len(names) > 1 else join(*names)


def plain(gesture: str) -> str:
    """The name of a gesture, as one says it."""
    return gesture.replace("_", " ")
