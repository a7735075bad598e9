"""How numbers are written: one way for each kind."""

from collections.abc import Sequence
from typing import Any

from .markup import Markup, join, tag

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
    if microseconds < 1000:
        return f"{microseconds:.3g}{THIN}µs" if microseconds < 100 else f"{microseconds:.0f}{THIN}µs"
    return f"{microseconds / 1000:.3g}{THIN}ms" if microseconds < 1e6 else f"{microseconds / 1e6:.3g}{THIN}s"


def seconds(value: float | None) -> str:
    return NONE if value is None else duration(1e6 * value)


def size(count: float | None) -> str:
    """A number of bytes."""
    if count is None:
        return NONE
    for unit in ("B", "KiB", "MiB"):
        if count < 1024:
            return f"{count:.3g}{THIN}{unit}" if count < 1000 else f"{count:.0f}{THIN}{unit}"
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
    return join(*(part if last else join(part, ", ") for last, part in _with_last(parts))) if parts else Markup(NONE)


def listed(names: Sequence[str]) -> Markup:
    """a, b and c."""
    if len(names) < 2:
        return join(*names)
    return join(*(join(name, ", ") for name in names[:-2]), names[-2], " and ", names[-1])


def plain(gesture: str) -> str:
    """The name of a gesture, as one says it."""
    return gesture.replace("_", " ")


def _with_last(parts: list[Markup]) -> list[tuple[bool, Markup]]:
    return [(k == len(parts) - 1, part) for k, part in enumerate(parts)]
