"""The values that a front end works on: a frame, its touches, and the segment that is cut out of frames."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """The frames of one gesture: conditioned, at the sensor's own grid and rate.

    The frames before `first` and after `last` are quiet context, which a model's window may take in.
    """

    frames: NDArray[np.float32]  # (T, R, C) counts above the baseline
    times: NDArray[np.float64]  # (T,) seconds, strictly increasing
    first: int  # index of the first touched frame
    last: int  # index of the last touched frame
    noise: float  # counts, one standard deviation of an idle taxel
    lost: int = 0  # frames that went missing between `first` and `last`
    bad: NDArray[np.bool_] | None = None  # (R, C) taxels that are bridged from their neighbours; None is none

    @property
    def onset(self) -> float:
        """Time of the first touched frame in seconds."""
        return float(self.times[self.first])

    @property
    def offset(self) -> float:
        """Time of the last touched frame in seconds."""
        return float(self.times[self.last])
