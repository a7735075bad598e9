"""What is known of each sensor now, for metrics and `gesturectl status`."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

STATES = ("ok", "starting", "degraded", "stale", "no_data", "faulty")  # from good to bad


@dataclass(frozen=True, slots=True)
class Reading:
    """One sensor's, or several together at their worst."""

    state: str
    rate_hz: float = 0.0
    jitter_s: float = 0.0
    bad_taxels: int = 0
    drift: float = 0.0  # in units of noise


def together(readings: Sequence[Reading]) -> Reading:
    """Several sensors as one: the worst of each, and all their bad taxels."""
    return Reading(
        max((r.state for r in readings), key=STATES.index),
        min(r.rate_hz for r in readings),
        max(r.jitter_s for r in readings),
        sum(r.bad_taxels for r in readings),
        max(r.drift for r in readings),
    )


def by_label(readings: Mapping[str, Reading], label_of: Callable[[str], str]) -> dict[str, Reading]:
    """Readings by sensor -> by label of the metrics; several sensors may share one."""
    found: dict[str, list[Reading]] = {}
    for sensor, reading in readings.items():
        found.setdefault(label_of(sensor), []).append(reading)
    return {label: each[0] if len(each) == 1 else together(each) for label, each in found.items()}
