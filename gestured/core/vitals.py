"""How a sensor's stream is: its jitter, and the baseline from which it drifts."""

import numpy as np
from numpy.typing import NDArray

from gestured.core.front_end import FrontEnd

FAULTY = 0.25  # of the taxels bad: what is bridged between them is guesswork
WEIGHT = 1 / 16  # of the newest interval in the jitter (RFC 3550, 6.4.1)


class Vitals:
    """Jitter and first baseline of one sensor."""

    def __init__(self) -> None:
        self.jitter_s = 0.0
        self.first: NDArray[np.float64] | None = None  # (N,) counts
        self._last: float | None = None

    def arrived(self, now: float, frames: int, rate_hz: float) -> None:
        """`frames` came together at `now` s. Interarrival jitter as RTP has it."""
        if self._last is not None and rate_hz > 0:
            self.jitter_s += (abs(now - self._last - frames / rate_hz) - self.jitter_s) * WEIGHT
        self._last = now

    def review(self, front_end: FrontEnd) -> None:
        """Keep the first baseline that was learned. Beside the way of a frame, now and then."""
        if self.first is None and front_end.ready:
            self.first = front_end.baseline

    def silent(self) -> None:
        """The sensor has fallen silent: the next interval says nothing of its jitter."""
        self._last = None

    def restart(self) -> None:
        """The sensor is learned anew."""
        self.first = None


def faulty(front_end: FrontEnd) -> bool:
    """Whether too many taxels are bad."""
    return front_end.bad_taxels > FAULTY * front_end.rows * front_end.columns
