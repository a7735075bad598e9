"""The latest frames of one sensor, the segments that are cut out of them, and what a hole in one may hide.

A hole is a time in which nobody saw the finger. It may hide a turn, a lift, a second tap or a circle. It hides none of
them where the finger goes on behind it as it came: straight on, or along the same bend, hardly slower than before; or
where it had moved and rests on both sides.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.conditioning import Conditioner, Look
from gestured.core.contact import RESTS, Centroid
from gestured.core.frames import UNDISTURBED, Before, Segment
from gestured.core.taxels import Inspection

LARGEST = float(np.finfo(np.float32).max)  # counts; the largest that a frame on the wire can hold
LEAD_S = 0.15  # quiet frames kept before an onset: at 15 Hz two of them
LEAD_FRAMES = 200  # quiet frames kept at most: LEAD_S at 1000 Hz and more; a sensor's own clock may all but stand still
HOLE_S = 0.25  # after longer without a frame nobody knows what the finger did meanwhile
HOLE_FRAMES = 2.5  # intervals of the sensor: a slow sensor's hole may last so many, whatever the seconds
CLEAR_S = 0.45  # the longest hole that a clear path excuses: five frames lost in a row at 15 Hz
SIDE = 3  # frames at most on each side of a hole from which its way is taken
STRAIGHT = math.radians(40.0)  # angle up to which the way across the hole goes straight on from the way beside it
BENT = math.radians(75.0)  # angle up to which that holds where both ways bend to the same side, as on a circle
SLOWEST = 0.75  # times the speed beside the hole: a finger slower than that has turned a corner, or stopped


_new = tuple.__new__  # Kept(...) takes twice the time


class Kept(NamedTuple):
    """A frame that a segment may need."""

    t: float  # s
    above: NDArray[np.float64]  # (N,) counts above the baseline
    lost: int  # frames, just before this one
    place: Centroid | None  # centroid, where the frame is touched
    new: float  # s, since when the sensor has shown just that: a frame that is repeated tells nothing


class Sight(NamedTuple):
    """Where the finger was seen."""

    t: float  # s
    place: Centroid


@dataclass(frozen=True, slots=True, eq=False)
class Made:
    """A segment made of the kept frames, and held so that the classifier is given the same object when it is cut."""

    segment: Segment
    peak: float  # counts
    bad: NDArray[np.bool_]  # (N,) taxels that are bridged in it
    inspection: Inspection


class Cutter:
    """Keeps the frames of a contact and shortly before it, and makes segments of them."""

    def __init__(self, conditioner: Conditioner, travel: float) -> None:
        """`travel`: taxel pitches that a finger may move and still be where it was."""
        self._conditioner = conditioner
        self._travel = travel
        self.kept: deque[Kept] = deque()
        self._made: Made | None = None
        self._before = UNDISTURBED  # what went on before the contact that goes on, or before the last one
        self._settled = -math.inf  # s, the last frame of the second from which the idle sensor was learned
        self.last_raw = b""  # raw counts of the last frame
        self.new = 0.0  # s, since when the frames show just these counts

    def __len__(self) -> int:
        """How many frames are kept."""
        return len(self.kept)

    def settled(self, t: float) -> None:
        """The idle sensor has been watched until `t` s, and is known."""
        self._settled = t

    def silent(self) -> None:
        """The stream paused: what follows was not seen to begin."""
        self.kept.clear()
        self._settled = -math.inf

    def clear(self) -> None:
        """The sensor restarted: what was kept is no part of what follows."""
        self.kept.clear()

    def keep(self, look: Look, lost: int, place: Centroid | None) -> None:
        """Take a frame. One that repeats the last is no news, unless the idle sensor repeats its frames, too."""
        t, shown = look.t, look.raw.tobytes()
        if shown != self.last_raw or not self._conditioner.idle.lively:
            self.new = t
        self.last_raw = shown
        self.kept.append(_new(Kept, (t, look.above, lost, place, self.new)))

    def trim(self, t: float) -> None:
        """Nothing is open at `t` s: keep what the next contact may need before its onset."""
        kept = self.kept
        while kept[0].t < t - LEAD_S or len(kept) > LEAD_FRAMES:
            kept.popleft()

    def begin(self, before: Before) -> None:
        """A contact begins, after what went on before it."""
        self._before = before

    def draft(self, onset: float, offset: float) -> Segment | None:
        """The segment of a contact that may be over; None where it has been asked for already."""
        before = self._made
        made = self._make(onset, offset)
        return None if made is before else made.segment

    def so_far(self, onset: float, offset: float) -> Segment:
        """The segment of a contact that is not over; a later `draft` or `cut` does not see it."""
        return self._segment(onset, offset)[0]

    def cut(self, onset: float, offset: float) -> Made:
        """The segment of a contact that is over, made after the contact has shown which taxels are stuck."""
        self._conditioner.judge(self._make(onset, offset).inspection)
        made, self._made = self._make(onset, offset), None
        return made

    def hole(self, onset: float, offset: float, until: float) -> float:
        """The longest time in s in which a finger may have done anything unseen, from before the onset to `until` s.

        It is infinite where the finger's arrival was not seen. What comes after `until` does not count.
        """
        last, longest = self._settled, 0.0
        for new in (*(kept.new for kept in self.kept), until):
            if new >= onset and new - last > longest:
                if not HOLE_S < new - last <= CLEAR_S or not self._clear(onset, last, new, offset):
                    longest = new - last
            last = new
        return longest

    def _clear(self, onset: float, begin: float, end: float, offset: float) -> bool:
        """Whether nothing hides in the hole from `begin` to `end` s of a contact."""
        if any(begin < kept.t < end for kept in self.kept):
            return False  # the sensor repeated a frame, so the segment shows a finger at rest that may have moved
        seen = [Sight(k.t, k.place) for k in self.kept if k.place is not None and onset <= k.t <= offset]
        before, after = [one for one in seen if one.t <= begin], [one for one in seen if one.t >= end]
        return clear(before, after, self._travel)

    def _make(self, onset: float, offset: float) -> Made:
        """The segment of a contact: made once, unless a taxel has turned out to be bad since."""
        made, conditioner = self._made, self._conditioner
        if made is not None and (made.segment.onset, made.segment.offset) == (onset, offset):
            if np.array_equal(made.bad, conditioner.taxels.bad):
                return made
        segment, stack = self._segment(onset, offset)
        inspection = conditioner.inspect(stack[segment.first : segment.last + 1])
        self._made = Made(segment, float(segment.frames.max()), conditioner.taxels.bad, inspection)
        return self._made

    def _segment(self, onset: float, offset: float) -> tuple[Segment, NDArray[np.float64]]:
        """The segment of all that is kept, and (T, N) counts above the baseline before bad taxels are bridged."""
        kept, conditioner = list(self.kept), self._conditioner
        times = np.array([frame.t for frame in kept])
        stack = np.array([frame.above for frame in kept])
        first = int(np.searchsorted(times, onset))
        last = int(np.searchsorted(times, offset))
        frames = np.clip(conditioner.taxels.bridge(stack), -LARGEST, LARGEST).astype(np.float32)
        lost = sum(frame.lost for frame in kept[first + 1 : last + 1])
        bad = conditioner.taxels.bad.reshape(frames.shape[1:])
        segment = Segment(frames, times, first, last, conditioner.idle.level, lost, self._before, bad)
        return segment, stack


def bearable_s(interval_s: float) -> float:
    """Seconds that a hole may last before it counts against a contact, where frames are `interval_s` apart."""
    return max(HOLE_S, HOLE_FRAMES * interval_s)


def clear(before: Sequence[Sight], after: Sequence[Sight], travel: float) -> bool:
    """Whether nothing hides between the last of `before` and the first of `after`, all that was seen of a contact.

    `travel`: taxel pitches that a finger may move and still be where it was.
    """
    if len(before) < 2 or len(after) < 2 or after[0].t - before[-1].t > CLEAR_S:
        return False
    across = _way(before[-1], after[0])
    sides = (before[-SIDE:], after[:SIDE])
    ways = [_way(side[0], side[-1]) for side in sides]
    if math.hypot(*across) < travel:
        came = max(math.dist(one.place, before[-1].place) for one in before)
        return came >= 2 * travel and all(math.hypot(*way) < RESTS for way in ways)
    bends = [_turn(way, across) for way in ways if math.hypot(*way) >= RESTS]
    one_way = len(bends) == 2 and bends[0] * bends[1] < 0  # it bends to one side on both sides of the hole
    if not bends or max(map(abs, bends)) > (BENT if one_way else STRAIGHT):
        return False
    usual = sum(math.hypot(*way) for way in ways) / sum(side[-1].t - side[0].t for side in sides)
    return math.hypot(*across) >= SLOWEST * usual * (after[0].t - before[-1].t)


def _way(one: Sight, other: Sight) -> Centroid:
    return other.place[0] - one.place[0], other.place[1] - one.place[1]


def _turn(one: Centroid, other: Centroid) -> float:
    """Radians from one way to another, positive to one side."""
    return math.atan2(one[0] * other[1] - one[1] * other[0], one[0] * other[0] + one[1] * other[1])
