"""How numbers are written: one way for each kind. What is missing is a dash."""

from collections.abc import Mapping
from typing import Any

from matplotlib.ticker import EngFormatter

NONE = "–"
THIN = "\u202f"  # a narrow space that does not break


def percent(share: float | None) -> str:
    """0.8321 -> 83.2; the unit stands in the heading or in the sentence."""
    return NONE if share is None else f"{100 * share:.1f}"


def number(value: float | None, form: str = ".2f") -> str:
    """A number in some form of Python's."""
    return NONE if value is None else format(value, form)


def interval(row: Mapping[str, Any]) -> str:
    """A row's confidence interval in per cent, empty where it has none."""
    low, high = row.get("low"), row.get("high")
    return "" if low is None or high is None else f"{percent(low)}–{percent(high)}"


def duration(microseconds: float) -> str:
    """In three digits and the unit that fits them."""
    return EngFormatter("s", sep=THIN)(float(f"{microseconds:.3g}") * 1e-6)


def values(hyperparameters: Mapping[str, Any] | None) -> str:
    """Hyperparameters by name; where they depend on the augmentation, those of each that differ from the first."""
    found = dict(hyperparameters or {})
    if not found or not all(isinstance(value, Mapping) for value in found.values()):
        return ", ".join(f"{name} = {_value(value)}" for name, value in found.items()) or NONE
    known, *others = found.items()
    return "; ".join([values(known[1]), *(f"{name}: {values(of)}" for name, of in others if of != known[1])])


def _value(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
