"""The cutter: it keeps the latest frames of one sensor, cuts segments out of them, and finds holes in them.

A hole is a time in which nobody saw the finger. It may hide a turn, a lift, a second tap or a circle. It hides nothing
if the finger goes on after the hole as before it (straight on or along the same bend, and hardly slower), or if the
finger had moved and rests on both sides of the hole.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.conditioning import Conditioner, Look
from gestured.core.contact import RESTS, Centroid
from gestured.core.frames import QUIET_S, UNDISTURBED, Before, Segment
from gestured.core.taxels import Still

LARGEST = float(np.finfo(np.float32).max)  # counts; the largest that a frame on the wire can hold
LEAD_S = 0.15  # quiet frames are kept for so long before an onset, at 15 Hz two of them
LEAD_FRAMES = 200  # the most quiet frames kept: more than LEAD_S at 1000 Hz, since a sensor's clock may stand still
HOLE_S = 0.25  # after longer without a frame nobody knows what the finger did meanwhile
HOLE_FRAMES = 2.5  # a slow sensor's hole may last so many of its intervals, even if that is more than HOLE_S
CLEAR_S = 0.45  # the longest hole that a clear path excuses: five frames lost in a row at 15 Hz
MOST_BEFORE = 64  # the most contacts that are remembered, since more in ten seconds say nothing new
SIDE = 3  # the most frames on each side of a hole by which the finger's way there is told
STRAIGHT = math.radians(40.0)  # the largest angle between the ways across and beside a hole that is still straight on
BENT = math.radians(75.0)  # the largest such angle if the finger bends to one side throughout, as on a circle
SLOWEST = 0.75  # times the speed beside the hole: a slower finger has turned a corner, or stopped


Sight = tuple[float, Centroid]  # s, and where the finger was seen then
_new = tuple.__new__  # Kept(...) takes twice the time


class Kept(NamedTuple):
    """A frame that a segment may need."""

    t: float  # s
    above: NDArray[np.float64]  # (N,) counts above the baseline
    lost: int  # frames that went missing just before this one
    place: Centroid | None  # None for a quiet frame
    new: float  # s, when the sensor first sent these counts, since a repeated frame tells nothing


class Cutter:
    """The frames of a contact and shortly before it, and the segments that are made of them."""

    def __init__(self, conditioner: Conditioner, travel: float) -> None:
        """`travel`: taxel pitches that a finger may move and still be where it was."""
        self._conditioner = conditioner
        self._travel = travel
        self.kept: deque[Kept] = deque()
        # The segment that was made last, and its unmoved taxels; `cut` gives the same object that `draft` has given.
        self._made: tuple[Segment, Still] | None = None
        self._before = UNDISTURBED  # what went on before the contact that goes on, or before the last one
        self._began: deque[float] = deque(maxlen=MOST_BEFORE)  # s, the onsets of the contacts in the last QUIET_S
        self._ended = -math.inf  # s, the end of the last contact
        self._length_s = 0.0  # length of the last contact
        self.settled = -math.inf  # s, the last frame of the second from which the idle sensor was learned
        self.last_raw = b""  # raw counts of the last frame
        self.new = 0.0  # s, when the sensor first sent these counts

    def silent(self) -> None:
        """The stream paused: what follows was not seen to begin."""
        self.kept.clear()
        self.settled = -math.inf

    def keep(self, look: Look, lost: int, place: Centroid | None) -> None:
        """Keep a frame. One that repeats the last tells nothing new, unless the idle sensor repeats frames, too."""
        t, shown = look.t, look.raw.tobytes()
        if shown != self.last_raw or not self._conditioner.idle.lively:
            self.new = t
        self.last_raw = shown
        self.kept.append(_new(Kept, (t, look.above, lost, place, self.new)))

    def trim(self, t: float) -> None:
        """Forget the frames that the next contact will not need, since nothing is open at `t` s."""
        kept = self.kept
        while kept[0].t < t - LEAD_S or len(kept) > LEAD_FRAMES:
            kept.popleft()

    def begin(self, t: float, covered: float, rest: float) -> None:
        """A contact begins at `t` s. `covered` and `rest` say what rests on the sensor, as in `Before`."""
        began = self._began
        while began and t - began[0] > QUIET_S:
            began.popleft()
        quiet_s = min(t - self._ended, QUIET_S)
        length_s = self._length_s if quiet_s < QUIET_S else 0.0
        self._before = Before(quiet_s, len(began), length_s, covered, rest)
        began.append(t)

    def end(self, t: float) -> None:
        """The contact is over at `t` s, or what had rested has left then."""
        self._ended = t
        if self._began:
            self._length_s = max(t - self._began[-1], 0.0)

    def draft(self, onset: float, offset: float) -> Segment | None:
        """The segment of a contact that may be over; None if it was given already."""
        before = self._made
        made = self._make(onset, offset)
        return None if made is before else made[0]

    def cut(self, onset: float, offset: float) -> Segment:
        """The segment of a contact that is over, made after the contact has shown which taxels are stuck."""
        made = self._make(onset, offset)
        if self._conditioner.taxels.judge(made[1]):
            self._conditioner.review()
            made = self._make(onset, offset)
        self._made = None
        return made[0]

    def hole(self, onset: float, offset: float, until: float) -> float:
        """The longest time in s in which the finger may have moved unseen, from before the onset to `until` s.

        It is infinite if the finger's arrival was not seen.
        """
        last, longest = self.settled, 0.0
        for new in (*(kept.new for kept in self.kept), until):
            if new >= onset and new - last > longest:
                if not HOLE_S < new - last <= CLEAR_S or not self._clear(onset, last, new, offset):
                    longest = new - last
            last = new
        return longest

    def _clear(self, onset: float, begin: float, end: float, offset: float) -> bool:
        """Whether nothing hides in the hole from `begin` to `end` s of a contact."""
        if any(begin < kept.t < end for kept in self.kept):
            return False  # the sensor repeated a frame: the segment shows a finger at rest, which may have moved
        seen = [(k.t, k.place) for k in self.kept if k.place is not None and onset <= k.t <= offset]
        before, after = [one for one in seen if one[0] <= begin], [one for one in seen if one[0] >= end]
        return clear(before, after, self._travel)

    def _make(self, onset: float, offset: float) -> tuple[Segment, Still]:
        """The segment of a contact, made only once unless a taxel has turned out to be bad since."""
        made, taxels = self._made, self._conditioner.taxels
        if made is not None and (made[0].onset, made[0].offset) == (onset, offset):
            if made[0].bad is not None and np.array_equal(made[0].bad.reshape(-1), taxels.bad):
                return made
        segment, stack = self.segment(onset, offset)
        self._made = segment, taxels.inspect(stack[segment.first : segment.last + 1], self._conditioner.idle.level)
        return self._made

    def segment(self, onset: float, offset: float) -> tuple[Segment, NDArray[np.float64]]:
        """The segment of all that is kept, and (T, N) counts above the baseline before bad taxels are bridged.

        It does not count as the segment that was made last.
        """
        kept, conditioner = list(self.kept), self._conditioner
        times = np.array([frame.t for frame in kept])
        stack = np.array([frame.above for frame in kept])
        first, last = int(times.searchsorted(onset)), int(times.searchsorted(offset))
        frames = np.clip(conditioner.taxels.bridge(stack), -LARGEST, LARGEST).astype(np.float32)
        lost = sum(frame.lost for frame in kept[first + 1 : last + 1])
        bad = conditioner.taxels.bad.reshape(frames.shape[1:])
        return Segment(frames, times, first, last, conditioner.idle.level, lost, self._before, bad), stack


def bearable_s(interval_s: float) -> float:
    """Seconds that a hole may last before it counts against a contact whose frames are `interval_s` apart."""
    return max(HOLE_S, HOLE_FRAMES * interval_s)


def clear(before: Sequence[Sight], after: Sequence[Sight], travel: float) -> bool:
    """Whether nothing hides between the last of `before` and the first of `after`, all that was seen of a contact.

    `travel`: taxel pitches that a finger may move and still be where it was.
    """
    if len(before) < 2 or len(after) < 2 or after[0][0] - before[-1][0] > CLEAR_S:
        return False
    across = _way(before[-1], after[0])
    sides = (before[-SIDE:], after[:SIDE])
    ways = [_way(side[0], side[-1]) for side in sides]
    if math.hypot(*across) < travel:
        came = max(math.dist(place, before[-1][1]) for _, place in before)
        return came >= 2 * travel and all(math.hypot(*way) < RESTS for way in ways)
    bends = [_turn(way, across) for way in ways if math.hypot(*way) >= RESTS]
    one_way = len(bends) == 2 and bends[0] * bends[1] < 0  # the way bends to the same side before and after the hole
    if not bends or max(map(abs, bends)) > (BENT if one_way else STRAIGHT):
        return False
    usual = sum(math.hypot(*way) for way in ways) / sum(side[-1][0] - side[0][0] for side in sides)
    return math.hypot(*across) >= SLOWEST * usual * (after[0][0] - before[-1][0])


def _way(one: Sight, other: Sight) -> Centroid:
    (_, (row, column)), (_, (down, across)) = one, other
    return down - row, across - column


def _turn(one: Centroid, other: Centroid) -> float:
    """Radians from one way to another, positive to one side."""
    return math.atan2(one[0] * other[1] - one[1] * other[0], one[0] * other[0] + one[1] * other[1])
