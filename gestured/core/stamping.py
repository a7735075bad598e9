"""Stamps of a sensor's frames: when each was felt, though frames arrive bunched, late, twice or out of order."""

import math
from collections import deque
from collections.abc import Sequence
from typing import Literal, NamedTuple

from gestured.core.wire import Arrival

Counted = tuple[int, Literal["", "duplicate", "late"], bool]
ONE: Counted = (1, "", False)  # a frame without a counter counts as the one after the last
_new = tuple.__new__  # Stamp(...) takes twice the time


class Stamp(NamedTuple):
    """When a frame was felt, and what its counter says."""

    t: float  # s on the stream's clock, strictly increasing; NaN for a dropped frame
    lost: int  # frames that went missing just before this one
    dropped: Literal["", "duplicate", "late"]  # why the frame must not be used
    restarted: bool  # the sensor began anew: what was learned of it no longer holds
    implausible: bool  # clock "sensor": the time tag was missing or impossible, so the arrival was used


class Stamper:
    """What gives the frames of one sensor their times.

    With the `clock` "arrival", a frame was felt when it arrived. With "sensor", its time is the last one plus the
    step of the time tags, if that is forward and at most `MAX_STEP_S`; else the arrival is used. Without a counter, a
    tag that is a little older than the last one shows that the frame was overtaken on its way. Frames of one call
    that share a time are spaced backwards from it at the rate seen so far (`PERIOD_S` apart until that is known), by
    the counter or evenly, and never before the last frame. So stamp all waiting frames in one call: a stall then
    does no harm.
    """

    PERIOD_S = 1 / 15  # between frames at the nominal rate
    MAX_STEP_S = 10.0  # a longer step from one time tag to the next is not believed
    AHEAD_S = 86_400.0  # a recording may be sent faster than it was felt, but a stamp a day after its arrival is wrong
    MIN_STEP_S = 1e-6  # between stamps if the clock stood still; a double tells them apart even after 30 years
    REORDER = 16  # a frame whose counter is further back was not overtaken on its way: the sensor began anew
    REORDER_S = 0.5  # if a counter goes back after a longer pause, the sensor began anew
    STREAK = 3  # if the counters of so many late frames in a row rise by one, the sensor began anew
    OVERTAKEN_S = 1.0  # if a time tag goes back further, or STREAK times in a row, the sensor's clock was set
    RECENT = 15  # the usual interval is the median of so many, a second of a sensor at 15 Hz
    LEAP = 10_000  # if a counter jumps further (ten seconds at 1000 Hz), the sensor began anew, and nothing was lost

    def __init__(self, clock: Literal["arrival", "sensor"] = "arrival") -> None:
        self.by_tag = clock == "sensor"
        self.intervals: deque[float] = deque(maxlen=self.RECENT)
        self.last: float | None = None  # s, the last stamp
        self.arrived = 0.0  # s, the arrival of the frame that was stamped last
        self.tag: float | None = None  # s, the time tag of that frame
        self.ahead = 0.0  # s by which that frame's stamp lies beyond its tag, if an earlier frame had the same tag
        self.counter: int | None = None  # of the newest frame
        self.late: tuple[int, int] = (0, 0)  # counter of the last late frame, and how many of them came in a row
        self.overtaken = 0  # how many frames in a row had an older time tag

    def at(self, arrived: float) -> float:
        """The stream's time in s of a frame that `arrived` then (s): the last stamp plus the time since its arrival."""
        return arrived if self.last is None else self.last + max(0.0, arrived - self.arrived)

    def past(self, arrived: float) -> float:
        """The stream's time in s until which every frame had arrived at `arrived` (s).

        A sensor's own clock is known only by its frames, and may have stood still since the last one.
        """
        return self.last if self.by_tag and self.last is not None else self.at(arrived)

    def when(self, t: float) -> float:
        """The arrival time in s at which the stream's time is `t` s; the inverse of `at`."""
        return t if self.last is None else self.arrived + (t - self.last)

    def stamp(self, arrivals: Sequence[Arrival], arrived: float, *, missed: bool = False) -> list[Stamp]:
        """One stamp for each of this sensor's frames that were waiting when they `arrived`, in s.

        `missed`: packets may have been lost on this machine just before. A counter tells how many of them were this
        sensor's; without a counter, as many frames count as lost as fit into the pause.
        """
        if len(arrivals) == 1 and not missed:
            return [self._alone(arrivals[0], arrived)]
        if self.by_tag and not missed and len({arrival.timetag for arrival in arrivals}) == len(arrivals):
            return [self._alone(arrival, arrived) for arrival in arrivals]
        before, usual = self.last, self._typical() if missed else math.nan
        stamps: list[Stamp] = []
        run: list[tuple[int, int]] = []  # frames with one time: index, periods since the frame before
        for i, arrival in enumerate(arrivals):
            pause = 0.0 if run else arrived - self.arrived
            steps, dropped, restarted = self._count(arrival.counter, pause)
            stamps.append(Stamp(math.nan, max(0, steps - 1), dropped, restarted, False))
            if dropped:
                continue
            if self.by_tag and run and arrival.timetag != arrivals[run[-1][0]].timetag:
                self._place(arrivals, stamps, run, arrived)
                run = []
            run.append((i, steps))
        if run:
            self._place(arrivals, stamps, run, arrived)
        if missed and before is not None and arrivals[0].counter is None:
            stamps[0] = stamps[0]._replace(lost=max(0, round((stamps[0].t - before) / usual) - 1))
        return stamps

    def _alone(self, arrival: Arrival, arrived: float) -> Stamp:
        """The stamp of a frame that shares its time with no other: the same as by `_place`, with fewer steps."""
        steps, dropped, restarted = ONE
        _, _, counter, tag, _ = arrival
        before = self.counter
        if counter is not None and before is not None and counter - before == 1:  # true of nearly all frames
            self.counter, self.late = counter, (0, 0)
        elif counter is not None or before is not None:
            steps, dropped, restarted = self._count(counter, arrived - self.arrived)
            if dropped:
                return Stamp(math.nan, 0, dropped, False, False)
        elif self.by_tag and self._was_overtaken(tag):
            return Stamp(math.nan, 0, "late", False, False)
        t, last, implausible = arrived, self.last, self.by_tag and tag is None
        if last is not None:
            if self.by_tag:
                step, implausible = self._step(last, tag, arrived)
                t = last + step
            if t > last:
                self.intervals.append((t - last) / steps)
            if t < last + self.MIN_STEP_S:
                t = last + self.MIN_STEP_S
        self.last, self.arrived, self.tag = t, arrived, tag
        return _new(Stamp, (t, steps - 1, "", restarted, implausible))

    def _was_overtaken(self, tag: float | None) -> bool:
        """Whether a frame without a counter was overtaken on its way, as its time `tag` (s) shows."""
        older = tag is not None and self.tag is not None and 0 < self.tag - tag <= self.OVERTAKEN_S
        self.overtaken = self.overtaken + 1 if older else 0
        return 0 < self.overtaken < self.STREAK

    def _count(self, counter: int | None, pause: float) -> Counted:
        """(periods since the frame before, why it is dropped, whether the sensor restarted)."""
        before, self.counter = self.counter, counter
        if counter is None or before is None:
            return ONE
        step = (counter - before + 2**31) % 2**32 - 2**31  # an int32 that wraps
        if 0 < step <= self.LEAP:
            self.late = (0, 0)
            return step, "", False
        if step == 0:
            return 0, "duplicate", False
        late, streak = self.late
        streak = streak + 1 if streak and counter == late + 1 else 1
        if -step <= self.REORDER and step < 0 and pause <= self.REORDER_S and streak < self.STREAK:
            self.counter, self.late = before, (counter, streak)
            return 0, "late", False
        self.late = (0, 0)
        return 1, "", True

    def _place(
        self, arrivals: Sequence[Arrival], stamps: list[Stamp], run: list[tuple[int, int]], arrived: float
    ) -> None:
        """Stamp the frames of `run`, which share one time and `arrived` together (s)."""
        tag = arrivals[run[-1][0]].timetag
        total = sum(steps for _, steps in run)
        implausible = False
        if self.last is None:
            end, spacing = arrived, self._typical()
            implausible = self.by_tag and tag is None
        else:
            end = arrived
            if self.by_tag:
                step, implausible = self._step(self.last, tag, arrived)
                end = self.last + step
            share = (end - self.last) / total
            spacing = min(self._typical(), share) if len(run) > 1 else share
            if share > 0:
                self.intervals.append(share)
        last = self.last
        for i, steps in run:
            total -= steps
            t = end - total * spacing
            if last is not None and t < last + self.MIN_STEP_S:
                t = last + self.MIN_STEP_S
            last = t
            stamps[i] = Stamp(t, stamps[i].lost, "", stamps[i].restarted, implausible)
        self.last, self.arrived, self.tag = last, arrived, tag

    def _step(self, last: float, tag: float | None, arrived: float) -> tuple[float, bool]:
        """Seconds since the `last` stamp by the time tag, or else by the arrival; and whether the tag is impossible."""
        step = tag - self.tag if tag is not None and self.tag is not None else 0.0
        if 0 < step <= self.MAX_STEP_S and last + step <= arrived + self.AHEAD_S:
            ahead = self.ahead if self.ahead <= self.REORDER_S else 0.0  # a clock that stood longer has lost that time
            self.ahead = max(ahead - step, 0.0)
            return max(step - ahead, 0.0), False
        waited = arrived - self.arrived
        # A coarse clock shows one time for several frames. Their stamps go beyond it, and that is no step of the clock.
        self.ahead = self.ahead + waited if tag is not None and tag == self.tag else 0.0
        return waited, tag is None or self.tag is not None

    def _typical(self) -> float:
        """Seconds between two frames: the median, since a late frame must not count."""
        return sorted(self.intervals)[len(self.intervals) // 2] if self.intervals else self.PERIOD_S
