"""How a sensor's stream is: jitter, and how far its baseline has drifted. Read by metrics and `gesturectl status`."""

import numpy as np
from numpy.typing import NDArray

from gestured.core.recognizer import FrontEnd

FAULTY = 0.25  # of the taxels bad: what is bridged between them is guesswork


class Vitals:
    """Of one sensor. `arrived` belongs into the way of a frame, `review` beside it, once a second."""

    def __init__(self) -> None:
        self.jitter_s = 0.0
        self.drift = 0.0  # median taxel's way from the first baseline, in units of noise
        self._last: float | None = None
        self._first: NDArray[np.float64] | None = None

    def arrived(self, now: float, frames: int, rate_hz: float) -> None:
        """`frames` came together at `now` s. Interarrival jitter as RTP has it (RFC 3550, 6.4.1)."""
        if self._last is not None and rate_hz > 0:
            self.jitter_s += (abs(now - self._last - frames / rate_hz) - self.jitter_s) / 16
        self._last = now

    def review(self, front_end: FrontEnd) -> None:
        """Compare the baseline with the first one that was learned."""
        if not front_end.ready:
            return
        # What an empty frame would deviate by is the baseline, turned over.
        baseline = -front_end.conditioner.deviation(np.zeros(front_end.rows * front_end.columns))[0]
        if self._first is None or self._first.shape != baseline.shape:
            self._first = baseline
        self.drift = float(np.median(np.abs(baseline - self._first))) / max(front_end.noise, 1e-30)

    def silent(self) -> None:
        """The sensor has fallen silent: the next interval says nothing of its jitter."""
        self._last = None

    def restart(self) -> None:
        """The sensor is learned anew."""
        self._first, self.drift = None, 0.0


def faulty(front_end: FrontEnd) -> bool:
    """Whether too many taxels are bad."""
    return front_end.bad_taxels > FAULTY * front_end.rows * front_end.columns
