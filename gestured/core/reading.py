"""What is known of a sensor at a moment: for status, metrics and whoever else wants a number."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gestured.core.quantiles import median

# From good to bad.
STATES = ("ok", "starting", "degraded", "intermittent", "inverted", "stale", "no_data", "faulty")
SILENT = ("no_data", "stale")  # states of sensors that are not there now
SMALLEST = 1e-30  # counts; noise that is nothing divides nothing


@dataclass(frozen=True, slots=True)
class Reading:
    """One sensor at a moment; all but the state and the grid are 0 or None where it was never heard.

    `state`: "no_data" (in the configuration, never heard), "starting", "ok", "degraded" (taxels are bridged), "faulty"
    (too many are), "intermittent" (it falls silent between touches), "inverted" (its counts fall when it is touched) or
    "stale" (heard, but not now).
    """

    state: str
    grid: tuple[int, int]  # as it is sent
    interval_s: float = 0.0  # from frame to frame, as they came
    jitter_s: float = 0.0
    bad_taxels: int = 0
    noise: float = 0.0  # counts
    source: tuple[str, int] | None = None
    heard: float = 0.0  # s, on the hub's clock
    lost: int = 0  # frames
    lost_at: float | None = None  # s, on the hub's clock: when the last of them were
    exchanged: bool = False  # touches look like a finger's with rows and columns the other way round
    touched: bool = False
    contact: int | None = None  # id of the contact that was not released yet
    sequence: int = 0  # of its last gesture
    segments: int = 0  # so far; the last one's id
    first: NDArray[np.float64] | None = None  # (N,) counts: the first baseline that was learned
    baseline: NDArray[np.float64] | None = None  # (N,) counts: today's

    @property
    def rate_hz(self) -> float:
        """Frames a second; 0 before it is known, and where the sensor is silent."""
        return 1.0 / self.interval_s if self.interval_s > 0 and self.state not in SILENT else 0.0

    @property
    def drift(self) -> float:
        """The median taxel's way from the first baseline, in units of noise."""
        if self.first is None or self.baseline is None or self.first.shape != self.baseline.shape:
            return 0.0
        return float(median(np.abs(self.baseline - self.first))) / max(self.noise, SMALLEST)
