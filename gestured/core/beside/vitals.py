"""How a sensor's stream is: its jitter, its silences, and the baseline from which it drifts."""

import numpy as np
from numpy.typing import NDArray

from gestured.core.front_end import FrontEnd

SHORT_S = 5.0  # frames between two silences for no longer than this are no more than some gestures
STRETCHES = 3  # short stretches in a row after which a sensor is said to send only while it is touched
FAULTY = 0.25  # share of the taxels: where so many are bad, what is bridged between them is guesswork
WEIGHT = 1 / 16  # weight of the newest interval in the jitter (RFC 3550, 6.4.1)


class Vitals:
    """Jitter, silences and first baseline of one sensor."""

    def __init__(self) -> None:
        self.jitter_s = 0.0
        self.interval_s = 0.0  # from frame to frame, as of the last tick; 0 before it is known
        self.first: NDArray[np.float64] | None = None  # (N,) counts
        self._last: float | None = None
        self._began = 0.0  # s, the first frame after the last silence
        self._stretches = 0  # short ones, in a row

    @property
    def intermittent(self) -> bool:
        """Whether the sensor falls silent again and again, after a few seconds each time."""
        return self._stretches >= STRETCHES and (self._last is None or self._last - self._began < SHORT_S)

    def arrived(self, now: float, frames: int, *, missed: bool) -> None:
        """`frames` came together at `now` s. Interarrival jitter as RTP has it.

        `missed`: this machine may have had no room for frames before these. Then the silence before them need not be
        the sensor's own, and short stretches are counted anew.
        """
        if missed:
            self._stretches = 0
        if self._last is not None and self.interval_s > 0:
            self.jitter_s += (abs(now - self._last - frames * self.interval_s) - self.jitter_s) * WEIGHT
        if self._last is None:
            self._began = now
        self._last = now

    def review(self, front_end: FrontEnd) -> None:
        """Keep the first baseline that was learned, and the interval. Beside the way of a frame, with each tick."""
        self.interval_s = front_end.interval_s
        if self.first is None and front_end.ready:
            self.first = front_end.baseline

    def silent(self) -> None:
        """The sensor has fallen silent: the next interval says nothing of its jitter."""
        if self._last is not None:
            self._stretches = self._stretches + 1 if self._last - self._began < SHORT_S else 0
        self._last = None

    def restart(self) -> None:
        """The sensor is learned anew."""
        self.first = None


def faulty(front_end: FrontEnd) -> bool:
    """Whether too many taxels are bad."""
    return front_end.bad_taxels > FAULTY * front_end.rows * front_end.columns
