"""Conditioning and segmentation of one sensor: frames in, segments out."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gestured.core.conditioning import Conditioner, Inspection, Mounting
from gestured.core.events import Cancelled, Onset, Release
from gestured.core.frames import Frame, Segment, Touch
from gestured.core.segmentation import TOUCHED, Action, Phase, Segmenter, Timing

LARGEST = float(np.finfo(np.float32).max)  # counts; also what a frame on the wire can hold
LEAD_S = 0.15  # quiet frames kept before an onset: at 15 Hz two of them
LEAD_FRAMES = 200  # the same at 1000 Hz, and some: a sensor's own clock may all but stand still
DRAFT_S = 0.085  # quiet for so long, all that a window takes in is there; the wait goes on to see the finger stay off


@dataclass(frozen=True, slots=True)
class Cut:
    """A segment that is complete and waits for its name."""

    id: int
    segment: Segment
    decided: float  # s, the frame that completed it
    hole_s: float = 0.0  # the longest time from one frame to the next until then


@dataclass(frozen=True, slots=True)
class _Made:
    """A segment as it was made, perhaps before it was cut."""

    segment: Segment
    peak: float  # counts
    bad: NDArray[np.bool_]  # (N,) taxels that are bridged in it
    inspection: Inspection


Contact = Onset | Cut | Cancelled | Release
# t, (N,) counts above the baseline, touches, lost, since when the sensor shows the same
Kept = tuple[float, NDArray[np.float64], tuple[Touch, ...], int, float]


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
        self.rows, self.columns = self.mounting.shape(rows, columns)
        self.timing = timing or Timing()
        self.conditioner = Conditioner(self.rows, self.columns)
        travel = self.timing.tap_travel * min(self.rows, self.columns)
        self.segmenter = Segmenter(rows * columns, travel, wait_for_double_tap=wait_for_double_tap, timing=self.timing)
        self._mounted = self.mounting != Mounting()
        self._kept: deque[Kept] = deque()
        self._made: _Made | None = None
        self.draft: Segment | None = None  # made by the last push: what will be cut if the finger stays off
        self.segments = 0  # so far; their ids
        self._last: float | None = None
        self._settled = -math.inf  # s, the last frame of the quiet second after which the sensor was ready
        self._now = 0.0  # s, when the last frame came, or the one that is about to
        self._shown = b""  # by the last frame,
        self._since = 0.0  # s, and since when; of a sensor that stands still when idle that says nothing
        self._interval = 0.0
        self._shifted: float | None = None  # s, since when the frames lie far below the baseline

    @property
    def ready(self) -> bool:
        """Whether the idle sensor is known, so that a touch can be told from it."""
        return self.conditioner.ready

    @property
    def touched(self) -> bool:
        """Whether a contact is going on, given up or not."""
        return self.segmenter.phase is not Phase.IDLE

    @property
    def noise(self) -> float:
        """Counts, one standard deviation of the median taxel."""
        return self.conditioner.noise

    @property
    def bad_taxels(self) -> int:
        """How many taxels are bridged from their neighbours."""
        return int(np.count_nonzero(self.conditioner.bad))

    @property
    def interval_s(self) -> float:
        """Seconds from frame to frame as they come, 0 before it is known."""
        return self._interval

    @property
    def rate_hz(self) -> float:
        """Frames a second as they come, 0 before it is known."""
        return 1.0 / self._interval if self._interval > 0 else 0.0

    def due(self, t: float) -> list[Contact]:
        """What the time alone decides until a frame at `t` s. `push` decides it as well, after a look at the frame."""
        if not self.touched or self._last is None or not 0 < t - self._last <= self.timing.stale_s:
            return []
        self._now = t
        return self._acts(self.segmenter.flush(t), t)

    def push(self, frame: Frame) -> list[Contact]:
        """Take one frame; its time must lie after the last one's (ValueError), its grid must be the sensor's.

        One with a value that is not finite, or beyond float32, is passed over as if it had been lost.
        """
        t = frame.t
        out: list[Contact] = []
        self.draft = None
        values = self.mounting.frame(frame.values) if self._mounted else frame.values
        raw = values.astype(np.float64).reshape(-1)
        # What is no number is found by both; at this size `argmax` is cheaper than `max`.
        if not (raw.item(raw.argmax()) <= LARGEST and raw.item(raw.argmin()) >= -LARGEST):
            return out
        if self._last is not None:
            step = t - self._last
            if not step > 0:
                raise ValueError(f"frame times must increase: {t} s after {self._last} s")
            if step > self.timing.stale_s:
                out = self.flush(t)
            else:
                out = self.due(t)
                self._interval += (step - self._interval) * (0.05 if self._interval else 1.0)
        self._last = self._now = t
        conditioner, segmenter = self.conditioner, self.segmenter
        if not conditioner.ready:
            if conditioner.settle(t, raw):
                self._settled = t
            return out
        d, activity, lowest = conditioner.deviation(raw)
        sunken = lowest < -segmenter.on
        level = max(segmenter.on, segmenter.after_effect(t)) if sunken else segmenter.on
        burst = lowest < -level
        if burst and conditioner.shifted(d, level):
            # Interference passes and its frames are lost; a sensor that restarted, or a hand that left, stays so.
            self._shifted = t if self._shifted is None else self._shifted
            if t - self._shifted >= self.timing.shift_s:
                out += self._restart(keep=True)
            conditioner.settle(t, raw)
            return out
        self._shifted = None
        kept = self._kept
        shown, self._shown = self._shown, raw.tobytes()
        if shown != self._shown or not conditioner.lively:
            self._since = t
        kept.append((t, d, frame.touches, frame.lost, self._since))
        place = conditioner.place(d) if activity >= segmenter.off else None
        out += self._acts(segmenter.push(t, activity, place), t)
        if len(kept) > self.timing.limit_frames:
            out += self.give_up(t)
        if segmenter.phase in TOUCHED:
            conditioner.busy(t, raw, d)
            if segmenter.let_go() and t - segmenter.last_touched >= DRAFT_S:
                self._make_draft(segmenter.onset, segmenter.last_touched)
            return out
        while kept[0][0] < t - LEAD_S or len(kept) > LEAD_FRAMES:
            kept.popleft()
        if segmenter.phase is Phase.IDLE:
            conditioner.idle(t, raw, d, activity, sunken=sunken, burst=burst, recovering=segmenter.recovering(t))
        else:
            conditioner.settle(t, raw)  # what stays on the sensor becomes part of its baseline
        return out

    def give_up(self, t: float) -> list[Contact]:
        """A contact that goes on has taken too long by another clock than its frames': it is cancelled as held."""
        return self._acts(self.segmenter.give_up(t), t)

    def flush(self, t: float) -> list[Contact]:
        """The stream paused or ended at `t` s: close what is open."""
        out: list[Contact] = []
        if self._last is not None:
            t = min(t, self._last + self.timing.stale_s)  # it was over then, whenever one asks
        if self.touched:
            out += self._acts(self.segmenter.flush(t), t)
        if self.touched:
            out += self._act(Action.CLOSE, t) if self.segmenter.let_go() else self._cancel("silence")
        self.segmenter.reset()
        self._kept.clear()
        self._settled = -math.inf
        self.conditioner.doubt()
        return out

    def reset(self) -> list[Contact]:
        """The sensor restarted: start clean and learn the idle sensor anew; an open contact is cancelled."""
        return self._restart(keep=False)

    def _restart(self, *, keep: bool) -> list[Contact]:
        out = self._cancel("restart") if self.touched else []
        self.segmenter.reset()
        self.conditioner.reset(keep=keep)
        self._kept.clear()
        self._shifted = None
        return out

    def _acts(self, actions: list[Action], t: float) -> list[Contact]:
        return [contact for action in actions for contact in self._act(action, t)]

    def _act(self, action: Action, t: float) -> list[Contact]:
        offset = self.segmenter.last_touched
        if action is Action.OPEN:
            self.segments += 1
            return [Onset(self.sensor, self.segments, t)]
        if action is Action.HELD:
            return [Cancelled(self.sensor, self.segments, "held")]
        if action is Action.LEFT:
            return [Release(self.sensor, self.segments, offset)]
        if action is Action.SPLIT:
            first = self._closed(t, self.segmenter.split_onset, self.segmenter.earlier)
            self.segments += 1
            return [*first, Onset(self.sensor, self.segments, self.segmenter.onset)]
        return self._closed(t, self.segmenter.onset, offset)

    def _closed(self, t: float, onset: float, offset: float) -> list[Contact]:
        release = Release(self.sensor, self.segments, offset)
        if self._glitch(onset, offset):
            return [Cancelled(self.sensor, self.segments, "glitch"), release]
        self.conditioner.judge(self._make(onset, offset).inspection)
        made, self._made = self._make(onset, offset), None
        if made.peak < self.segmenter.off * made.segment.noise:  # nothing is left without its bad taxels
            return [Cancelled(self.sensor, self.segments, "stuck"), release]
        return [Cut(self.segments, made.segment, t, self._hole(onset)), release]

    def _cancel(self, reason: str) -> list[Contact]:
        release = Release(self.sensor, self.segments, self.segmenter.last_touched)
        if self.segmenter.phase is Phase.SPENT:  # has been cancelled already
            return [release]
        return [Cancelled(self.sensor, self.segments, reason), release]

    def _glitch(self, onset: float, offset: float) -> bool:
        """Whether the longest that a contact can have lasted is shorter than any finger's."""
        return offset - onset + self._interval < self.timing.glitch_s

    def _make_draft(self, onset: float, offset: float) -> None:
        before = self._made
        if not self._glitch(onset, offset):
            made = self._make(onset, offset)
            self.draft = made.segment if made is not before else None

    def _make(self, onset: float, offset: float) -> _Made:
        """The segment of a contact: made once, unless a taxel has turned out to be bad since."""
        made = self._made
        if made is not None and (made.segment.onset, made.segment.offset) == (onset, offset):
            if np.array_equal(made.bad, self.conditioner.bad):
                return made
        times = np.array([k[0] for k in self._kept])
        stack = np.array([k[1] for k in self._kept])
        first = int(np.searchsorted(times, onset))
        last = int(np.searchsorted(times, offset))
        frames = np.clip(self.conditioner.bridge(stack), -LARGEST, LARGEST).astype(np.float32)
        touches: tuple[tuple[Touch, ...], ...] = ()
        if any(k[2] for k in self._kept):
            touches = tuple(tuple(self._mount(touch) for touch in k[2]) for k in self._kept)
        lost = sum(k[3] for k in list(self._kept)[first + 1 : last + 1])
        segment = Segment(frames, times, first, last, self.conditioner.noise, lost, touches)
        inspection = self.conditioner.inspect(stack[first : last + 1])
        self._made = made = _Made(segment, float(frames.max()), self.conditioner.bad, inspection)
        return made

    def _hole(self, onset: float) -> float:
        """The longest time in s in which a finger may have moved unseen, from before the onset to the last frame.

        Infinite where nobody saw it come. Of a sensor that says no more nobody knows, and that counts for nothing.
        """
        last, longest = self._settled, 0.0
        for since in (*(k[4] for k in self._kept), self._now):
            if since >= onset:
                longest = max(longest, since - last)
            last = since
        return longest

    def _mount(self, touch: Touch) -> Touch:
        return Touch(touch.id, *self.mounting.point(touch.x, touch.y, *self.sent))
