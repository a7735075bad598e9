"""The waits of segmenter and front end (docs/limits-and-choices.md gives the reasons), and the pace of frames."""

import math
from dataclasses import dataclass

RANGE_HZ = (5.0, 1000.0)  # the rates for which segmenter and models are made
MARGIN = 1.1  # factor by which a measured rate may lie outside of RANGE_HZ, since clocks differ
SHARE = 0.05  # share of a new interval in the usual one: one late frame says little


@dataclass(frozen=True, slots=True)
class Timing:
    """Durations in seconds. At 15 Hz they lie half-way between frames, so that jitter cannot flip a decision."""

    release_s: float = 0.10  # quiet after which the finger is off
    tap_gap_s: float = 0.50  # quiet in which a second tap may begin: gaps of up to 0.4 s, as seen at 15 Hz
    tap_s: float = 0.57  # a tap is at most this long
    tap_travel: float = 0.15  # a tap moves at most this share of the grid's shorter side
    limit_s: float = 5.03  # a contact that lasts longer is no gesture
    limit_frames: int = 6000  # a contact of more frames is given up, since a sensor's own clock may nearly stand still
    stale_s: float = 1.0  # a silence that ends every contact
    shift_s: float = 0.25  # if frames are far below the baseline for so long, the sensor has restarted
    glitch_s: float = 0.02  # a contact surely shorter than this is no finger


class Pace:
    """The times of a sensor's frames, in seconds on the stream's clock."""

    def __init__(self) -> None:
        self.last: float | None = None  # s, the last frame
        self.interval_s = 0.0  # from frame to frame as they come, 0 before it is known

    @property
    def sure(self) -> float:
        """The time in s until which no frame is overdue, so that all is known of what the sensor has shown."""
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
        """Take a frame at `t` s, `step` s after the last one; a silence says nothing of the usual interval."""
        self.last = t
        if not after_silence:
            self.interval_s += (step - self.interval_s) * (SHARE if self.interval_s else 1.0)

    def longest_s(self, first: float, last: float) -> float:
        """The longest time in s that something shown by the frames from `first` to `last` s can have lasted."""
        return last - first + self.interval_s


def outside(rate_hz: float) -> bool:
    """Whether a rate lies so far outside of RANGE_HZ that nothing is promised; false as long as it is unknown (0)."""
    return rate_hz > 0 and not RANGE_HZ[0] / MARGIN <= rate_hz <= RANGE_HZ[1] * MARGIN
