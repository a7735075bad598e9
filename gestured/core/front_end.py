"""One sensor's way from frame to segment: frames in, what was found in them out."""

import numpy as np
from numpy.typing import NDArray

from gestured.core.conditioning import Conditioner, Look
from gestured.core.cutter import LARGEST, Cutter
from gestured.core.events import Cancelled, Onset, Release
from gestured.core.found import Contact, Cut, Found
from gestured.core.frames import Frame
from gestured.core.habits import Habits
from gestured.core.mounting import Mounting
from gestured.core.pace import Pace
from gestured.core.segmenter import Action, Deed, Segmenter
from gestured.core.timing import Timing
from gestured.core.unfinished import Unfinished


class FrontEnd:
    """Frames of one sensor in, segments out. `rows` x `columns` is the grid as sent, before mounting."""

    def __init__(
        self,
        sensor: str,
        rows: int,
        columns: int,
        *,
        mounting: Mounting | None = None,
        wait_for_double_tap: bool = True,
        timing: Timing | None = None,
    ) -> None:
        self.sensor = sensor
        self.sent = (rows, columns)
        self.mounting = mounting or Mounting()
        self.timing = timing or Timing()
        self.segments = 0  # so far; their ids
        self.previews = False  # whether contacts are shown before they are over
        self.conditioner = Conditioner(self.rows, self.columns)
        travel = self.timing.tap_travel * min(rows, columns)
        self._segmenter = Segmenter(rows * columns, travel, wait_for_double_tap=wait_for_double_tap, timing=self.timing)
        self._cutter = Cutter(self.conditioner, travel)
        self.habits = Habits(rows, columns)
        self.latest: tuple[Frame | None, Look | None] = (None, None)  # the last frame, and how it was seen
        self._pace = Pace()
        self._unfinished = Unfinished(self._segmenter, self._cutter, self._pace, self.timing)
        self._below_since: float | None = None  # s, since when the frames lie far below the baseline

    @property
    def rows(self) -> int:
        """Rows of taxels after mounting."""
        return self.mounting.shape(*self.sent)[0]

    @property
    def columns(self) -> int:
        """Columns of taxels after mounting."""
        return self.mounting.shape(*self.sent)[1]

    @property
    def ready(self) -> bool:
        """Whether the idle sensor is known, so that a touch can be told from it."""
        return self.conditioner.ready

    @property
    def touched(self) -> bool:
        """Whether a contact is going on, given up or not."""
        return self._segmenter.phase.touched

    @property
    def baseline(self) -> NDArray[np.float64]:
        """(N,) counts of the idle sensor after mounting, row by row; replaced, never changed in place."""
        return self.conditioner.baseline.counts

    @property
    def noise(self) -> float:
        """Counts, one standard deviation of the median taxel."""
        return self.conditioner.noise.level

    @property
    def bad_taxels(self) -> int:
        """How many taxels are bridged from their neighbours."""
        return self.conditioner.taxels.count

    @property
    def interval_s(self) -> float:
        """Seconds from frame to frame as they come, 0 before it is known."""
        return self._pace.interval_s

    @property
    def rate_hz(self) -> float:
        """Frames a second as they come, 0 before it is known."""
        return 1.0 / self.interval_s if self.interval_s > 0 else 0.0

    def levels(self, t: float) -> tuple[str, tuple[float, float]]:
        """The segmenter's phase at `t` s, and the activity (noise units) that is strong then, and not quiet."""
        return self._segmenter.phase.name, self._segmenter.levels(t)

    def push(self, frame: Frame) -> list[Found]:
        """Take one frame, give all that was found, in order.

        Its time must lie after the last one's (ValueError), its grid must be the sensor's. One with a value that is
        not finite, or beyond float32, is passed over as if it had been lost.
        """
        t = frame.t
        raw = self.mounting.frame(frame.values).astype(np.float64).reshape(-1)
        # What is no number is found by both; at this size `argmax` is cheaper than `max`.
        if not (raw.item(raw.argmax()) <= LARGEST and raw.item(raw.argmin()) >= -LARGEST):
            return []
        found = self._pass(t)
        conditioner, segmenter, cutter = self.conditioner, self._segmenter, self._cutter
        if not conditioner.ready:
            self.latest = frame, None
            if conditioner.settle(t, raw):
                cutter.settled(t)
            return found
        look = conditioner.look(t, raw, segmenter.after)
        self.latest = frame, look
        if look.burst and (fallen := conditioner.fallen(look)) >= segmenter.on:
            self.habits.fall(t, frame.values, fallen)
        if look.shifted:
            return found + self._shift(look)
        self._below_since = None
        touches = self.mounting.touches(frame.touches, *self.sent) if frame.touches else ()
        place = conditioner.place(look) if look.activity >= segmenter.off else None
        cutter.keep(look, touches, frame.lost, place)
        deeds = segmenter.push(t, look.activity, place)
        if deeds:
            found += self._done(deeds, t)
        if segmenter.phase.pending and len(cutter) > self.timing.limit_frames:
            found += self.give_up(t)
        if segmenter.phase.pending:
            self.habits.pressed(frame.values, look.activity)
            conditioner.busy(look)
            found += self._unfinished.show(self.segments, t, previews=self.previews)
            return found
        cutter.trim(t)
        if segmenter.phase.touched:
            conditioner.settle(t, raw)  # what stays on the sensor becomes part of its baseline
        else:
            self.habits.idle(t, frame.values)
            conditioner.idle(look, recovering=segmenter.after.recovering(t))
        return found

    @property
    def due(self) -> float | None:
        """When `wait` will find something unless a frame comes before, in s. None where there is nothing to wait for.

        Where a frame is overdue before that moment, nothing is decided without it: it may show the finger again.
        """
        off = self._unfinished.due if self.previews else None
        due = self._segmenter.over if off is None else off  # that a finger is off shows before a contact is over
        return due if due is not None and due <= self._pace.sure else None

    def wait(self, t: float) -> list[Found]:
        """No frame has come until `t` s: a finger may be off, a contact may be over. A later frame finds the same."""
        found: list[Found] = []
        until = min(t, self._pace.sure)
        if self.previews and (off := self._unfinished.due) is not None and off <= until:
            found += self._unfinished.wait(self.segments, off)
        if (over := self._segmenter.over) is not None and over <= until:
            found += self._done(self._segmenter.flush(until, until), t)
        return found

    def give_up(self, t: float) -> list[Contact]:
        """A contact that goes on has taken too long by another clock than its frames': it is cancelled as held."""
        return self._done(self._segmenter.give_up(t), t)

    def flush(self, t: float) -> list[Found]:
        """The stream paused or ended at `t` s: close what is open."""
        found = self.wait(t)
        segmenter, last = self._segmenter, self._pace.last
        if segmenter.phase.touched and last is not None:
            t = min(t, last + self.timing.stale_s)  # it was over then, whenever one asks
            found += self._done(segmenter.flush(t, self._pace.sure), last)
            if segmenter.phase.let_go:
                found += self._close(segmenter.onset, segmenter.last_touched, t, last)
            elif segmenter.phase.touched:
                found += self._cancel("silence")
        segmenter.reset()
        self._cutter.silent()
        self.conditioner.baseline.doubt()
        return found

    def reset(self) -> list[Contact]:
        """The sensor restarted: start clean and learn the idle sensor anew; an open contact is cancelled."""
        return self._restart(keep=False)

    def _pass(self, t: float) -> list[Found]:
        """Time passes until a frame at `t` s: what that alone decides. A frame cannot join what is over."""
        found: list[Found] = []
        segmenter, step = self._segmenter, self._pace.step(t)
        if step > self.timing.stale_s:
            found += self.flush(t)
        else:
            if segmenter.phase.touched:
                found += self.wait(t)
                found += self._done(segmenter.flush(t, self._pace.sure), t)
            self._pace.learn(step)
        self._pace.last = t
        if not segmenter.phase.touched:
            segmenter.after.fade(t)
        return found

    def _shift(self, look: Look) -> list[Contact]:
        """Frames far below the baseline. Interference passes, and they are lost; a sensor that restarted stays so."""
        found: list[Contact] = []
        if self._below_since is None:
            self._below_since = look.t
        if look.t - self._below_since >= self.timing.shift_s:
            found = self._restart(keep=True)
        self.conditioner.settle(look.t, look.raw)
        return found

    def _restart(self, *, keep: bool) -> list[Contact]:
        """Start clean. `keep`: the frames that may show the idle sensor as it is now count already."""
        found = self._cancel("restart") if self.touched else []
        self._segmenter.reset()
        self.conditioner.baseline.forget(keep=keep)
        self._cutter.clear()
        self._below_since = None
        if not keep:
            self.habits.clear()
        return found

    def _done(self, deeds: list[Deed], seen: float) -> list[Contact]:
        """What the segmenter decided, the sensor having been seen until then (s)."""
        found: list[Contact] = []
        for action, onset, offset, decided in deeds:
            if action is Action.OPEN:
                found += self._open(onset)
            elif action is Action.HELD:
                found.append(Cancelled(self.sensor, self.segments, "held"))
            elif action is Action.LEFT:
                found.append(Release(self.sensor, self.segments, offset))
            else:
                found += self._close(onset, offset, decided, min(seen, decided))
                if action is Action.SPLIT:
                    found += self._open(self._segmenter.onset)
        return found

    def _open(self, onset: float) -> list[Contact]:
        """A segment begins, with the next id."""
        self.segments += 1
        self.habits.rise()
        self._unfinished.begin()
        return [Onset(self.sensor, self.segments, onset)]

    def _close(self, onset: float, offset: float, t: float, seen: float) -> list[Contact]:
        """A segment is over, as decided at `t` s: it is cut, unless it was no finger's."""
        release = Release(self.sensor, self.segments, offset)
        if self._pace.longest_s(onset, offset) < self.timing.glitch_s:
            return [Cancelled(self.sensor, self.segments, "glitch"), release]
        self.habits.touched()
        made = self._cutter.cut(onset, offset)
        if made.peak < self._segmenter.off * made.segment.noise:  # nothing is left without its bad taxels
            return [Cancelled(self.sensor, self.segments, "stuck"), release]
        return [Cut(self.segments, made.segment, t, self._cutter.hole(onset, offset, seen)), release]

    def _cancel(self, reason: str) -> list[Contact]:
        """The contact that goes on has no answer, and ends."""
        release = Release(self.sensor, self.segments, self._segmenter.last_touched)
        if not self._segmenter.phase.pending:  # it has been cancelled already
            return [release]
        return [Cancelled(self.sensor, self.segments, reason), release]
