"""How numbers are written: one way for each kind. What is missing is a dash."""

from collections.abc import Mapping
from typing import Any

from matplotlib.ticker import EngFormatter

NONE = "–"
THIN = "\u202f"  # a narrow space that does not break


def percent(share: float | None, digits: int = 1) -> str:
    """0.8321 -> 83.2; the unit stands in the heading or in the sentence."""
    return NONE if share is None else f"{100 * share:.{digits}f}"


def with_unit(share: float | None, digits: int = 1) -> str:
    """A share in percent with its unit: 0.8321 -> 83.2 %."""
    return NONE if share is None else f"{percent(share, digits)}{THIN}%"


def points(difference: float | None) -> str:
    """A difference of two shares, in percentage points with its sign."""
    return NONE if difference is None else f"{100 * difference:+.1f}".replace("-", "\u2212")


def interval(row: Mapping[str, Any]) -> str:
    """A row's confidence interval in percent, empty where it has none."""
    low, high = row.get("low"), row.get("high")
    return "" if low is None or high is None else f"{percent(low)}–{percent(high)}"


def duration(value: float | None, unit_s: float = 1e-6) -> str:
    """Microseconds, or another unit, in three digits and the unit that fits them."""
    return NONE if value is None else EngFormatter("s", sep=THIN)(float(f"{value:.3g}") * unit_s)


def count(number: int | None) -> str:
    """A whole number with its thousands apart."""
    return NONE if number is None else f"{number:,}".replace(",", THIN)


def number(value: Any) -> str:
    """A value of a hyperparameter."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def plain(gesture: Any) -> str:
    """The name of a gesture or group, as one says it."""
    return str(gesture).replace("_", " ")
