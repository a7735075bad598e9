"""Whether a captured take is fit to learn from: faults that a person at the sensor can still correct."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gestured.core.frames import Frame

STROKE_FRAMES = 3  # fewer touched frames show no movement; a tap needs one
GAP = 1.6  # times the usual step between two frames; a longer step has lost a frame (1.5, and some jitter)
RAIL_FRAMES = 3  # frames with a taxel at exactly the contact's largest count, fewer of which are chance
RAIL_SHARE = 0.3  # least share of a contact's frames with such a taxel
RAIL_TAXELS = 3  # taxels of one frame at exactly the largest count; so many are cut off whatever the other frames show
FINEST = 50  # steps between least and largest count; a sensor with fewer shows the same count again by chance


@dataclass(frozen=True, slots=True)
class Captured:
    """One captured gesture with idle frames around it; times in seconds on the sensor's clock."""

    frames: tuple[Frame, ...]
    onset: int  # first touched frame
    release: int  # last touched frame
    noise: float  # counts, one standard deviation of an idle taxel
    trouble: str = ""  # why the front end made no single gesture of it
    looks: str = ""  # the gesture that a model takes it for
    sure: float = 0.0  # 0..1, how sure the model is

    def values(self) -> NDArray[np.float64]:
        """(T, R, C) raw counts."""
        return np.array([frame.values for frame in self.frames], np.float64)

    def times(self) -> NDArray[np.float64]:
        """The time of each frame, (T,) s."""
        return np.array([frame.t for frame in self.frames])

    @property
    def seconds(self) -> float:
        """Seconds of touch, in which a frame stands for the time to the next one."""
        times = self.times()
        return float(times[self.release] - times[self.onset] + np.median(np.diff(times)))

    def peak(self) -> float:
        """Counts of the strongest taxel above what it shows untouched."""
        values = self.values()
        idle = np.median(values[: max(self.onset - 1, 1)], axis=0)
        return float((values - idle)[self.onset : self.release + 1].max())


def faults(take: Captured, gesture: str) -> list[str]:
    """What is wrong with a take of `gesture`; empty if nothing is."""
    found = [take.trouble] if take.trouble else []
    contact = slice(take.onset, take.release + 1)
    count = take.release - take.onset + 1
    if not gesture.endswith("_tap") and count < STROKE_FRAMES:
        found.append(f"too short: {count} touched frames, expected {STROKE_FRAMES} or more")
    if saturated(take.values()[contact]):
        found.append("saturated: the strongest taxels stand still at the end of their range; press less")
    missing = lost(take)
    if missing:
        found.append(f"lost frames: {missing} of {count + missing}")
    return found


def lost(take: Captured) -> int:
    """Frames that went missing during the contact: by the sensor's counter, or else by gaps in time."""
    frames = take.frames[take.onset : take.release + 1]
    counted = sum(frame.lost for frame in frames[1:])
    return counted or int(gaps(take.times())[take.onset : take.release].sum())


def gaps(times: NDArray[np.float64]) -> NDArray[np.int64]:
    """(T,) s -> (T - 1,) frames that seem to be missing between each two."""
    steps = np.diff(times)
    if not len(steps):
        return np.zeros(0, np.int64)
    usual = float(np.median(steps))
    return np.where(steps > GAP * usual, np.rint(steps / usual) - 1, 0).astype(np.int64)


def saturated(contact: NDArray[np.floating]) -> bool:
    """Whether the pressure of a contact (T, R, C) in counts was cut off at the top.

    Counts under a finger vary, and at the end of their range they stand still. A contact with fewer than `FINEST` steps
    of counts, the smallest of which may be a fraction, is never called cut off.
    """
    counts = np.unique(contact)
    top = counts[-1]
    if len(counts) < 2 or top - counts[0] < FINEST * np.diff(counts).min():
        return False
    at_top = (contact == top).sum(axis=(1, 2))
    return bool((at_top > 0).sum() >= max(RAIL_FRAMES, RAIL_SHARE * len(contact)) or at_top.max() >= RAIL_TAXELS)
