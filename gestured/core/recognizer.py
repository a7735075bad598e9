"""The one path from frames to events: conditioning, segmentation, classification, decision."""

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gestured.core.conditioning import Conditioner, Inspection, Mounting
from gestured.core.errors import ModelError
from gestured.core.events import Cancelled, Event, Gesture, Onset, Release, Unknown
from gestured.core.frames import Frame, Segment, Touch
from gestured.core.segmentation import TOUCHED, Action, Phase, Segmenter, Timing

LARGEST = float(np.finfo(np.float32).max)  # counts; also what a frame on the wire can hold
LEAD_S = 0.15  # quiet frames kept before an onset: at 15 Hz two of them
HOLE_S = 0.25  # without a frame, or so many of the sensor's intervals: who knows what the finger did meanwhile
HOLE_FRAMES = 2.5
DRAFT_S = 0.085  # quiet for so long, all that a window takes in is there; the wait goes on to see the finger stay off


@dataclass(frozen=True, slots=True)
class Scores:
    """What a classifier says of a segment."""

    values: NDArray[np.float32]  # (G,) probabilities given that it is one of the gestures, in the classifier's order
    unknown: float  # probability that it is none of them
    model: str
    degraded: bool = False  # a fallback answered
    threshold: float = 0.5  # confidence from which the model's calibration has it published
    took_s: float = 0.0  # s that the model ran

    @property
    def confidence(self) -> float:
        """Of the best gesture."""
        return float(self.values.max()) * (1.0 - self.unknown)


class Classifier(Protocol):
    """Anything that scores segments: a model, or a ladder of them."""

    gestures: tuple[str, ...]

    def classify(self, segment: Segment) -> Scores:
        """Score one segment; raises ModelError where it cannot."""
        ...


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
    bad: NDArray[np.bool_]  # (N,) taxels that are bridged in it
    inspection: Inspection


Contact = Onset | Cut | Cancelled | Release
# t, (N,) counts above the baseline, touches, lost, whether it is no repetition of the last one
Kept = tuple[float, NDArray[np.float64], tuple[Touch, ...], int, bool]


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
        self._shown = b""  # by the last frame
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

    def push(self, frame: Frame) -> list[Contact]:
        """Take one frame; its time must lie after the last one's (ValueError), its grid must be the sensor's.

        One with a value that is not finite, or beyond float32, is passed over as if it had been lost.
        """
        t = frame.t
        out: list[Contact] = []
        self.draft = None
        values = self.mounting.frame(frame.values) if self._mounted else frame.values
        raw = values.astype(np.float64).reshape(-1)
        if not np.abs(raw).max() <= LARGEST:
            return out
        if self._last is not None:
            step = t - self._last
            if not step > 0:
                raise ValueError(f"frame times must increase: {t} s after {self._last} s")
            if step > self.timing.stale_s:
                out = self.flush(t)
            else:
                self._interval += (step - self._interval) * (0.05 if self._interval else 1.0)
        self._last = t
        conditioner, segmenter = self.conditioner, self.segmenter
        if not conditioner.ready:
            conditioner.settle(t, raw)
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
        if segmenter.phase is not Phase.IDLE:
            for action in segmenter.flush(t):
                out += self._act(action, t)
        kept = self._kept
        shown, self._shown = self._shown, raw.tobytes()
        fresh = shown != self._shown or not conditioner.lively
        kept.append((t, d, frame.touches, frame.lost, fresh))
        place = conditioner.place(d) if activity >= segmenter.off else None
        for action in segmenter.push(t, activity, place):
            out += self._act(action, t)
        if segmenter.phase in TOUCHED:
            conditioner.busy(t, raw, d)
            if segmenter.let_go() and t - segmenter.last_touched >= DRAFT_S:
                self._make_draft(segmenter.onset, segmenter.last_touched)
            return out
        while kept[0][0] < t - LEAD_S:
            kept.popleft()
        if segmenter.phase is Phase.IDLE:
            conditioner.idle(t, raw, d, activity, sunken=sunken, burst=burst, recovering=segmenter.recovering(t))
        else:
            conditioner.settle(t, raw)  # what stays on the sensor becomes part of its baseline
        return out

    def flush(self, t: float) -> list[Contact]:
        """The stream paused or ended at `t` s: close what is open."""
        out: list[Contact] = []
        if self._last is not None:
            t = min(t, self._last + self.timing.stale_s)  # it was over then, whenever one asks
        if self.touched:
            for action in self.segmenter.flush(t):
                out += self._act(action, t)
        if self.touched:
            out += self._act(Action.CLOSE, t) if self.segmenter.let_go() else self._cancel("silence")
        self.segmenter.reset()
        self._kept.clear()
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
        segment = self._make(onset, offset).segment
        if float(segment.frames.max()) < self.segmenter.off * segment.noise:  # nothing is left without its bad taxels
            return [Cancelled(self.sensor, self.segments, "stuck"), release]
        return [Cut(self.segments, segment, t, self._hole(onset, t)), release]

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
        self._made = made = _Made(segment, self.conditioner.bad, inspection)
        return made

    def _hole(self, onset: float, t: float) -> float:
        """The longest time in s in which a finger may have moved unseen, from the last quiet frame before the onset until
        `t`; infinite where nobody saw it come. Of a sensor that says no more nobody knows, and it counts for nothing."""
        seen = [k[0] for k in self._kept if k[4]]
        if t == self._last:
            seen.append(t)
        before = bisect_left(seen, onset) - 1
        return float(np.diff(seen[before:]).max()) if before >= 0 else math.inf

    def _mount(self, touch: Touch) -> Touch:
        return Touch(touch.id, *self.mounting.point(touch.x, touch.y, *self.sent))


class Recognizer:
    """Frames of one sensor in, events out. `classifier` may be replaced between two frames.

    `gestures` restricts the answer to a subset; what falls to the others is not given to those that are left.
    `thresholds` are the confidences below which a gesture is unknown, where not the model's own is to hold.
    `refractory` are the seconds in which the same gesture is not published again.
    `witness` is told of each segment that was decided, and of its scores.

    The classifier is asked while the segmenter still waits whether the finger stays off: once it is sure, the answer
    is there. Where the finger comes back, that answer is thrown away.
    """

    def __init__(
        self,
        front_end: FrontEnd,
        classifier: Classifier,
        *,
        gestures: Sequence[str] | None = None,
        thresholds: Mapping[str, float] | None = None,
        refractory: Mapping[str, float] | None = None,
        sequence: int = 0,
        witness: Callable[[Segment, Scores], None] | None = None,
    ) -> None:
        self.front_end = front_end
        self.classifier = classifier
        self.sequence = sequence
        self._gestures = None if gestures is None else frozenset(gestures)
        self._thresholds = dict(thresholds or {})
        self._refractory = dict(refractory or {})
        self._last_offset: dict[str, float] = {}
        self._witness = witness
        self._scored: tuple[Segment, Scores] | None = None

    def push(self, frame: Frame) -> list[Event]:
        """Take one frame, give what it decides; see `FrontEnd.push`."""
        found = self.front_end.push(frame)
        if self.front_end.draft is not None:
            self._look_ahead(self.front_end.draft)
        return self._name(found) if found else []

    def flush(self, t: float) -> list[Event]:
        """The stream paused or ended at `t` s: decide what can be decided, cancel the rest."""
        return self._name(self.front_end.flush(t))

    def reset(self) -> list[Event]:
        """The sensor restarted: cancel what is open, learn the idle sensor anew."""
        return self._name(self.front_end.reset())

    def _name(self, found: list[Contact]) -> list[Event]:
        return [self._decide(x) if isinstance(x, Cut) else x for x in found]

    def _look_ahead(self, draft: Segment) -> None:
        try:
            self._scores(draft)
        except ModelError:
            pass  # it is asked again when the segment is cut

    def _scores(self, segment: Segment) -> Scores:
        """Raises ModelError."""
        if self._scored is None or self._scored[0] is not segment:
            self._scored = segment, self.classifier.classify(segment)
        return self._scored[1]

    def _decide(self, cut: Cut) -> Gesture | Unknown | Cancelled:
        sensor, segment = self.front_end.sensor, cut.segment
        try:
            answer = self._scores(segment)
        except ModelError:
            return Cancelled(sensor, cut.id, "model")
        if self._witness is not None:
            self._witness(segment, answer)
        scores = {
            gesture: float(value)
            for gesture, value in zip(self.classifier.gestures, answer.values, strict=True)
            if self._gestures is None or gesture in self._gestures
        }
        best = max(scores, key=scores.__getitem__)
        confidence = scores[best] * (1.0 - answer.unknown)
        frames = segment.last - segment.first + 1
        whole = cut.hole_s <= max(HOLE_S, HOLE_FRAMES * self.front_end.interval_s)
        if not whole or not confidence >= self._thresholds.get(best, answer.threshold):
            return Unknown(
                sensor, cut.id, confidence, segment.onset, segment.offset, cut.decided,
                frames, segment.lost, answer.model, answer.degraded, scores,
            )  # fmt: skip
        since = segment.onset - self._last_offset.get(best, -np.inf)
        if since < self._refractory.get(best, 0.0):
            return Cancelled(sensor, cut.id, "refractory")
        self._last_offset[best] = segment.offset
        self.sequence += 1
        return Gesture(
            sensor, cut.id, best, confidence, self.sequence, segment.onset, segment.offset, cut.decided,
            frames, segment.lost, answer.model, answer.degraded, scores,
        )  # fmt: skip
