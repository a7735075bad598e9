"""The values that a front end works on: a frame, its touches, the segment cut out of frames, and what was before it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SMALLEST = 1e-30  # counts; the least noise that anything is divided by
QUIET_S = 10.0  # s; a contact that is longer ago says nothing of the next one


@dataclass(frozen=True, slots=True)
class Touch:
    """A finger's position in taxel pitches: x to the right, y upward, origin bottom-left."""

    id: int
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class Frame:
    """One pressure frame as it came from the sensor, before conditioning."""

    t: float  # seconds on the stream's clock
    values: NDArray[np.generic]  # (R, C) raw counts; row 0 is the top row
    touches: tuple[Touch, ...] = ()
    lost: int = 0  # frames that the sensor's own counter says went missing just before this one


class Before(NamedTuple):
    """The past of a sensor when a contact began."""

    quiet_s: float = QUIET_S  # time since the last contact, at most `QUIET_S`
    recent: int = 0  # contacts that began in the last `QUIET_S`
    length_s: float = 0.0  # length of the last contact, if it was so recent
    covered: float = 0.0  # share of the taxels on which something rests that has become part of the baseline
    rest: float = 0.0  # noise units, the activity of what rests there


UNDISTURBED = Before()  # of a segment whose past is not known, as in a file of cut gestures


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """The frames of one gesture: conditioned, at the sensor's own grid and rate.

    The frames before `first` and after `last` are quiet ones, which a model's window may take in.
    """

    frames: NDArray[np.float32]  # (T, R, C) counts above the baseline
    times: NDArray[np.float64]  # (T,) seconds, strictly increasing
    first: int  # index of the first touched frame
    last: int  # index of the last touched frame
    noise: float  # counts, one standard deviation of an idle taxel
    lost: int = 0  # frames that went missing between `first` and `last`
    before: Before = UNDISTURBED
    bad: NDArray[np.bool_] | None = None  # (R, C) taxels that are bridged from their neighbours; None if none are

    @property
    def onset(self) -> float:
        """Time of the first touched frame in seconds."""
        return float(self.times[self.first])

    @property
    def offset(self) -> float:
        """Time of the last touched frame in seconds."""
        return float(self.times[self.last])
