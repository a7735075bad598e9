"""How a sensor's stream is: jitter, and how far its baseline has drifted. Read by metrics and `gesturectl status`."""

import numpy as np
from numpy.typing import NDArray

from gestured.core.front_end import FrontEnd
from gestured.core.settling import median

FAULTY = 0.25  # of the taxels bad: what is bridged between them is guesswork


class Vitals:
    """Of one sensor. `arrived` belongs into the way of a frame, `review` beside it, once a second."""

    def __init__(self) -> None:
        self.jitter_s = 0.0
        self._last: float | None = None
        self._first: NDArray[np.float64] | None = None

    def arrived(self, now: float, frames: int, rate_hz: float) -> None:
        """`frames` came together at `now` s. Interarrival jitter as RTP has it (RFC 3550, 6.4.1)."""
        if self._last is not None and rate_hz > 0:
            self.jitter_s += (abs(now - self._last - frames / rate_hz) - self.jitter_s) / 16
        self._last = now

    def review(self, front_end: FrontEnd) -> None:
        """Keep the first baseline that was learned."""
        if self._first is None and front_end.ready:
            self._first = front_end.conditioner.baseline

    def drift(self, front_end: FrontEnd) -> float:
        """The median taxel's way from the first baseline, in units of noise."""
        if self._first is None or not front_end.ready or self._first.shape != front_end.conditioner.baseline.shape:
            return 0.0
        way = np.abs(front_end.conditioner.baseline - self._first)
        return float(median(way)) / max(front_end.noise, 1e-30)

    def silent(self) -> None:
        """The sensor has fallen silent: the next interval says nothing of its jitter."""
        self._last = None

    def restart(self) -> None:
        """The sensor is learned anew."""
        self._first = None


def faulty(front_end: FrontEnd) -> bool:
    """Whether too many taxels are bad."""
    return front_end.bad_taxels > FAULTY * front_end.rows * front_end.columns
