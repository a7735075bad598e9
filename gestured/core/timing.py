"""The waits of the segmenter and of the front end (docs/limits-and-choices.md has the reasons); the pace of frames."""

import math
from dataclasses import dataclass

RANGE_HZ = (5.0, 1000.0)  # rates that everything here is made for
MARGIN = 1.1  # factor by which a rate may lie outside of RANGE_HZ: clocks differ, and a rate is measured
SHARE = 0.05  # share of the difference to the last interval that is followed: one late frame says little


@dataclass(frozen=True, slots=True)
class Timing:
    """Durations in seconds. At 15 Hz they lie half-way between frames, so that jitter cannot flip a decision."""

    release_s: float = 0.10  # quiet for so long, the finger is off
    tap_gap_s: float = 0.50  # a second tap may begin until then (gaps up to 0.4 s, seen through 15 Hz)
    tap_s: float = 0.57  # a tap is at most this long
    tap_travel: float = 0.15  # a tap moves at most this share of the grid's shorter side
    limit_s: float = 5.03  # a contact that lasts longer is no gesture
    limit_frames: int = 6000  # a contact of more frames is given up, since a sensor's own clock may all but stand still
    stale_s: float = 1.0  # silence that ends everything
    shift_s: float = 0.25  # frames far below the baseline for so long: the sensor restarted
    glitch_s: float = 0.02  # a contact surely shorter than this is no finger


class Pace:
    """The times of a sensor's frames, in seconds on the stream's clock."""

    def __init__(self) -> None:
        self.last: float | None = None  # s, the last frame
        self.interval_s = 0.0  # from frame to frame as they come, 0 before it is known

    @property
    def sure(self) -> float:
        """Until when no frame is overdue, in s: all that the sensor has sent for the time before is known."""
        return -math.inf if self.last is None else self.last + self.interval_s

    def step(self, t: float) -> float:
        """Seconds from the last frame to one at `t` s, 0 before the first. Raises ValueError where time goes back."""
        if self.last is None:
            return 0.0
        step = t - self.last
        if not step > 0:
            raise ValueError(f"frame times must increase: {t} s after {self.last} s")
        return step

    def take(self, t: float, step: float, *, after_silence: bool) -> None:
        """A frame has come at `t` s, `step` s after the last one; a silence says nothing of the usual interval."""
        self.last = t
        if not after_silence:
            self.interval_s += (step - self.interval_s) * (SHARE if self.interval_s else 1.0)

    def longest_s(self, first: float, last: float) -> float:
        """The longest that something can have lasted which frames from `first` to `last` s have shown."""
        return last - first + self.interval_s


def outside(rate_hz: float) -> bool:
    """Whether frames come so slowly or so fast that nothing is promised; not before the rate is known."""
    return rate_hz > 0 and not RANGE_HZ[0] / MARGIN <= rate_hz <= RANGE_HZ[1] * MARGIN
