"""The waits of the segmenter and of the front end; docs/limits-and-choices.md has the reasons."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Timing:
    """Durations in seconds. At 15 Hz they lie half-way between frames, so that jitter cannot flip a decision."""

    release_s: float = 0.10  # quiet this long: the finger is off
    tap_gap_s: float = 0.50  # a second tap may begin until then (gaps up to 0.4 s, seen through 15 Hz)
    tap_s: float = 0.57  # a tap is at most this long
    tap_travel: float = 0.15  # and stays within this share of the grid's shorter side
    limit_s: float = 5.03  # a contact that is no gesture any more
    limit_frames: int = 6000  # the same at 1000 Hz, where the sensor's own clock may all but stand still
    stale_s: float = 1.0  # silence that ends everything
    shift_s: float = 0.25  # frames far below the baseline for so long: the sensor restarted
    glitch_s: float = 0.02  # a contact surely shorter than this is no finger
