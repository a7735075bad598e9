"""The front end of one sensor: from its frames to the contacts and segments that were found in them.

A front end knows neither its sensor's name nor who asks. For each contact it gives `Opened`, then one of `Cut` and
`Void`, and at last `Ended`. When the finger may have left, it also gives the `Segment` that will be cut if the finger
stays off, so that a classifier can be asked meanwhile.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.conditioning import Conditioner, Look
from gestured.core.cutter import Cutter
from gestured.core.frames import Frame, Segment
from gestured.core.mounting import Mounting
from gestured.core.segmenter import IDLE, Action, Deed, Segmenter
from gestured.core.settling import PATIENCE_S
from gestured.core.taxels import RUBBISH_S
from gestured.core.timing import Pace, Timing

DRAFT_S = 0.085  # s of quiet after which all that a window takes in is there; the wait itself ends later


class Opened(NamedTuple):
    """A contact began."""

    onset: float  # s


class Cut(NamedTuple):
    """A segment that is complete and waits for its name."""

    segment: Segment  # the same object as the last `Segment`, unless a taxel has turned out to be bad since
    decided: float  # s, when it was complete
    hole_s: float  # the longest time until then in which the finger may have moved unseen


class Void(NamedTuple):
    """A contact of which no segment is made."""

    reason: str  # held, silence, restart, glitch, stuck


class Ended(NamedTuple):
    """A contact is over: the sensor was let go."""

    offset: float  # s


Found = Opened | Segment | Cut | Void | Ended


class FrontEnd:
    """Frames of one sensor in, segments out. `rows` x `columns` is the grid as sent, before mounting."""

    def __init__(
        self,
        rows: int,
        columns: int,
        *,
        mounting: Mounting | None = None,
        wait_for_double_tap: bool = True,
        timing: Timing | None = None,
    ) -> None:
        self.grid_sent = (rows, columns)  # before mounting
        self.mounting = mounting or Mounting()
        self.timing = timing or Timing()
        self.rows, self.columns = self.mounting.shape(rows, columns)  # after mounting
        self.conditioner = Conditioner(self.rows, self.columns)
        travel = self.timing.tap_travel * min(rows, columns)
        self.segmenter = Segmenter(rows * columns, travel, wait_for_double_tap=wait_for_double_tap, timing=self.timing)
        self.cutter = Cutter(self.conditioner, travel)
        self.as_sent = self.mounting == Mounting()
        self.last_sent: NDArray[np.generic] | None = None  # (R, C) counts of the last frame that was taken
        self.look: Look | None = None  # what that frame shows; None before the idle sensor is known
        # Whether the idle sensor is known without doubt, no taxel is bad, and nobody touches it. Then a bank may
        # take its next frame together with those of other sensors of the same `kind`.
        self.calm = False
        self.kind = rows, columns, self.mounting
        self.pace = Pace()
        self._below_since: float | None = None  # s, since when the frames lie far below the baseline
        self._lowest = np.zeros(0)  # (N,) counts, the lowest since then

    @property
    def ready(self) -> bool:
        """Whether the idle sensor is known, so that a touch can be told from it."""
        return self.conditioner.idle.known

    @property
    def touched(self) -> bool:
        """Whether a contact is going on, given up or not."""
        return self.segmenter.phase.touched

    @property
    def baseline(self) -> NDArray[np.float64]:
        """(N,) counts of the idle sensor after mounting, row by row; replaced, never changed in place."""
        return self.conditioner.idle.counts

    @property
    def noise(self) -> float:
        """Counts, one standard deviation of the median taxel."""
        return self.conditioner.idle.level

    @property
    def bad_taxels(self) -> int:
        """How many taxels are bridged from their neighbours."""
        return self.conditioner.taxels.count

    @property
    def rate_hz(self) -> float:
        """Frames a second as they come, 0 before it is known."""
        return 1.0 / self.pace.interval_s if self.pace.interval_s > 0 else 0.0

    def push(self, frame: Frame) -> list[Found]:
        """Take one frame; return all that was found, in order.

        Its time must lie after the last one's (ValueError). Its grid must be the sensor's, and its values finite and
        within float32, which is not checked.
        """
        t = frame.t
        values = frame.values if self.as_sent else self.mounting.frame(frame.values)
        raw = values.astype(np.float64).reshape(-1)
        found = self._pass(t)
        conditioner, segmenter, cutter = self.conditioner, self.segmenter, self.cutter
        self.last_sent, self.look, self.calm = frame.values, None, False
        if not conditioner.idle.known:
            if conditioner.settle(t, raw):
                cutter.settled = t  # the idle sensor has been watched until then
            return found
        if t >= conditioner.idle.glance and conditioner.idle.mistaken(t, raw) and segmenter.phase.pending:
            return found + self.reset()
        self.look = look = conditioner.look(t, raw, segmenter.after)
        if conditioner.idle.bare is not None and (bared := conditioner.unloaded(look, segmenter.after)) is not None:
            found += self._left()
            self.cutter.end(t)
            self.look = look = bared
        if look.shifted:
            return found + self._shift(look)
        self._below_since = None
        place = conditioner.place(look) if look.activity >= segmenter.off else None
        cutter.keep(look, frame.lost, place)
        deeds = segmenter.push(t, look.activity, place)
        if deeds:
            found += self._done(deeds, t)
        if segmenter.phase.pending:
            found += self._pressed(look)
            return found
        cutter.trim(t)
        if segmenter.phase.touched:
            rests = conditioner.wide(look) or t - segmenter.rests.began >= PATIENCE_S
            if conditioner.settle(t, raw, rests=True, restless=rests):  # what rests there is in the baseline now
                found += self._void("held")
        else:
            recovering = segmenter.after.recovering(t)
            conditioner.untouched(look, recovering=recovering)
            self.calm = conditioner.sound and not (recovering or look.sunken) and self.pace.interval_s > 0
        return found

    def _pressed(self, look: Look) -> Sequence[Found]:
        """A frame of a contact whose answer is open."""
        segmenter = self.segmenter
        if len(self.cutter.kept) > self.timing.limit_frames:
            return self.give_up(look.t)
        self.conditioner.touched(look)
        flickering = self.conditioner.taxels.flickering.rubbish or look.t - segmenter.onset < RUBBISH_S
        if self.conditioner.wide(look) and not flickering:
            if self.conditioner.settle(look.t, look.raw, rests=True, restless=True):
                return self._void("held")  # an arm that lies still is no gesture, but a finger beside it may make one
        else:
            self.conditioner.idle.settling.clear()
        if not segmenter.phase.let_go or look.t - segmenter.last_touched < DRAFT_S or self.fleeting:
            return ()
        segment = self.cutter.draft(segmenter.onset, segmenter.last_touched)
        return () if segment is None else (segment,)

    @property
    def due(self) -> float | None:
        """When `wait` will find something unless a frame comes before, in s; None if there is nothing to wait for.

        If a frame is overdue before that time, nothing is decided without it, since it may show the finger again.
        """
        over = self.segmenter.over
        return over if over is not None and over <= self.pace.sure else None

    def wait(self, t: float) -> list[Found]:
        """No frame has come until `t` s: a contact may be over. A later frame finds the same."""
        until, over = min(t, self.pace.sure), self.segmenter.over
        return [] if over is None or over > until else self._done(self.segmenter.wait(until, until), t)

    @property
    def fleeting(self) -> bool:
        """Whether the contact that goes on is so far surely shorter than any finger's."""
        return self.pace.longest_s(self.segmenter.onset, self.segmenter.last_touched) < self.timing.glitch_s

    def so_far(self) -> Segment | None:
        """The segment of the open contact as far as it has come; None if nothing is left without the bad taxels."""
        segment, _ = self.cutter.segment(self.segmenter.onset, self.segmenter.last_touched)
        return segment if segment.frames.max() >= self.segmenter.off * segment.noise else None

    def give_up(self, t: float) -> list[Found]:
        """Cancel the open contact as held: it has too many frames, or is too long by another clock than theirs."""
        return self._done(self.segmenter.give_up(t), t)

    def flush(self, t: float) -> list[Found]:
        """The stream paused or ended at `t` s: close what is open."""
        found = self.wait(t)
        segmenter, last = self.segmenter, self.pace.last
        if segmenter.phase.touched and last is not None:
            t = min(t, last + self.timing.stale_s)  # the silence ended the contact then, however late this call is
            found += self._done(segmenter.wait(t, self.pace.sure), last)
            if segmenter.phase.let_go:
                found += self._close(segmenter.onset, segmenter.last_touched, t, last)
            elif segmenter.phase.touched:
                found += self._cancel("silence")
        segmenter.reset()
        self.cutter.silent()
        self.conditioner.idle.doubt()
        self.calm = False
        # Frames that were read together share their memory until the last of them is gone.
        if self.last_sent is not None:
            self.last_sent = self.last_sent.copy()
        if self.look is not None:
            self.look = self.look._replace(raw=self.look.raw.copy(), above=self.look.above.copy())
        return found

    def reset(self, *, keep: bool = False, shown: NDArray[np.float64] | None = None) -> list[Found]:
        """The sensor restarted: start clean and learn the idle sensor anew; an open contact is cancelled.

        `keep`: frames that were offered as idle still count. `shown` counts stand for the baseline until then.
        """
        found = self._void("restart")
        self.conditioner.idle.forget(keep=keep, shown=shown)
        self._below_since, self.calm = None, False
        return found

    def _pass(self, t: float) -> list[Found]:
        """What the time before a frame at `t` s decides alone, since a frame cannot join a contact that is over."""
        found: list[Found] = []
        segmenter, step = self.segmenter, self.pace.step(t)
        if step > self.timing.stale_s:
            found += self.flush(t)
        elif segmenter.phase.touched:
            found += self.wait(t)
            found += self._done(segmenter.wait(t, self.pace.sure), t)
        self.pace.take(t, step, after_silence=step > self.timing.stale_s)
        if not segmenter.phase.touched:
            segmenter.after.fade(t)
        return found

    def _shift(self, look: Look) -> list[Found]:
        """Drop a frame far below the baseline. Where such frames last, the sensor has restarted: learn it anew."""
        found: list[Found] = []
        if self._below_since is None:
            self._below_since, self._lowest = look.t, look.raw
        self._lowest = np.minimum(self._lowest, look.raw)
        leaving = self.conditioner.idle.bare is not None  # what rests may be leaving, and `unloaded` will see it gone
        if look.t - self._below_since >= (self.timing.stale_s if leaving else self.timing.shift_s):
            found = self.reset(keep=True, shown=self._lowest)
        self.conditioner.settle(look.t, look.raw)
        return found

    def _left(self) -> list[Found]:
        """What rested on the sensor has left: an open contact was made by that thing, and is cancelled as held."""
        found = self._cancel("held") if self.touched else []
        self.segmenter.phase = IDLE
        self.cutter.kept.clear()
        self._forget_rubbish()
        return found

    def _void(self, reason: str) -> list[Found]:
        """Cancel the open contact, if any, and forget its frames: the baseline is another one from here on."""
        found = self._cancel(reason) if self.touched else []
        self.segmenter.reset()
        self.cutter.kept.clear()
        return found

    def _done(self, deeds: list[Deed], seen: float) -> list[Found]:
        """What the segmenter's deeds mean for the front end; the sensor was seen until `seen` (s)."""
        found: list[Found] = []
        for action, onset, offset, decided in deeds:
            if action is Action.OPEN:
                found.append(self._open(onset))
            elif action is Action.RISE:
                self.cutter.end(onset)
                self._begin(onset)
            elif action is Action.HELD:
                found.append(Void("held"))
            elif action is Action.LEFT:
                self._forget_rubbish()
                found.append(self._end(offset))
            else:
                found += self._close(onset, offset, decided, min(seen, decided))
                if action is Action.SPLIT:
                    found.append(self._open(self.segmenter.onset))
        return found

    def _open(self, onset: float) -> Opened:
        self._begin(onset)
        return Opened(onset)

    def _begin(self, onset: float) -> None:
        self.cutter.begin(onset, *self.conditioner.resting())
        self.conditioner.taxels.flickering.begin(onset)

    def _close(self, onset: float, offset: float, t: float, seen: float) -> list[Found]:
        """Cut the segment that was decided at `t` s, unless it was no finger's."""
        if self.pace.longest_s(onset, offset) < self.timing.glitch_s:
            return [Void("glitch"), self._end(offset)]
        segment = self.cutter.cut(onset, offset)
        nothing = float(segment.frames.max()) < self.segmenter.off * segment.noise  # without its bad taxels
        if self._forget_rubbish() or nothing:
            return [Void("stuck"), self._end(offset)]
        return [Cut(segment, t, self.cutter.hole(onset, offset, seen)), self._end(offset)]

    def _end(self, offset: float) -> Ended:
        self.cutter.end(offset)
        return Ended(offset)

    def _forget_rubbish(self) -> bool:
        """Whether the last contact was rubbish; if so, its after-effect is cleared, since rubbish leaves none."""
        if self.conditioner.taxels.flickering.rubbish:
            self.segmenter.after.clear()
        return self.conditioner.taxels.flickering.rubbish

    def _cancel(self, reason: str) -> list[Found]:
        """End the open contact without an answer."""
        ended = self._end(self.segmenter.last_touched)
        return [Void(reason), ended] if self.segmenter.phase.pending else [ended]  # else it has its `Void`
