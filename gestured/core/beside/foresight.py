"""Foresight: the provisional events of one sensor, and when a model is sure enough to give one.

A provisional event is no answer: the gesture, unknown or cancelled of the same id that follows confirms or revokes it.
No answer depends on what is kept here.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple, TypeVar

from gestured.core.events import Cancelled, Gesture, Provisional, Unknown
from gestured.core.frames import Segment
from gestured.core.front_end import DRAFT_S, FrontEnd
from gestured.core.points import Certainty
from gestured.core.scene import DOUBLE_TAP, ONE_TAP

PREVIEW_S = 0.0666  # the time between previews, 15 a second: a little less than 1/15 s because times are rounded
EACH_FRAME_S = 0.0635  # frames so far apart, or further, are all shown to the model: 5 % below 1/15 s, as rates vary

Answer = TypeVar("Answer", bound=Gesture | Unknown | Cancelled)


class Preview(NamedTuple):
    """A contact that is not over, as far as it has come."""

    segment: Segment
    t: float  # s, the time of this preview
    down: bool  # whether the finger is on the sensor; else it has left, perhaps for good
    drafted: bool  # whether the segment is the one that the front end has just given
    second: bool  # whether the second contact of the segment has begun, after a tap
    hole_s: float  # the longest time so far in which the finger may have moved unseen


class Foresight:
    """The previews of the open contact, and what was said of it: at most one provisional event for each id."""

    def __init__(self, sensor: str, *, taps: bool) -> None:
        """`taps`: whether one tap is said while a second one may still come."""
        self._sensor, self.taps = sensor, taps
        self.asked = False  # whether somebody asks for provisional events
        self.wanted: float | None = None  # s, the time as of which a model is to look at the open contact
        self._id = 0
        self._said: Provisional | None = None
        self._best = ""  # the gesture of which the model was sure enough at the last preview
        self._row = 0  # previews in a row that were sure enough of `_best`
        self._passed_over = 0  # frames since the last preview of a finger that is down
        self._left: float | None = None  # s, the offset of the contact of which it was shown that the finger is off

    def begin(self, number: int) -> None:
        """Begin another contact, of which nothing was shown or said; `number` is its id."""
        self._id, self._said, self._row, self._passed_over, self.wanted = number, None, 0, 0, None

    def due(self, front_end: FrontEnd) -> float | None:
        """When a finger that has left will have been off for `DRAFT_S`, in s; None if that was shown already."""
        offset = front_end.segmenter.last_touched
        return offset + DRAFT_S if self.asked and front_end.segmenter.phase.let_go and self._left != offset else None

    def see(self, front_end: FrontEnd, t: float) -> None:
        """Take note of a frame at `t` s, and set `wanted` if a model is to look at the open contact.

        While the finger is down, a model looks at most 15 times a second, at 15 Hz with every frame. Once the finger
        has left, the front end gives the segment itself.
        """
        self._pass_over()
        if front_end.segmenter.phase.let_go:
            if t - front_end.segmenter.last_touched >= DRAFT_S and not front_end.fleeting:
                self._left = front_end.segmenter.last_touched
            return
        if front_end.fleeting:
            return
        self._passed_over += 1
        interval_s = front_end.pace.interval_s
        if self._passed_over * interval_s < PREVIEW_S and interval_s < EACH_FRAME_S:
            return
        self._passed_over = 0
        self.wanted = t if self._said is None else None

    def wait(self, front_end: FrontEnd, until: float) -> None:
        """Set `wanted` if a model is to look once more because no frame has come by `until` s and the finger is off."""
        due = self.due(front_end)
        if due is not None and due <= until:
            self._pass_over()
            self._left = front_end.segmenter.last_touched
            self.wanted = due if self._said is None else None

    def _pass_over(self) -> None:
        """Drop the frame that waited for a look, if any, and with it the count of sure previews in a row."""
        if self.wanted is not None:
            self.wanted, self._row = None, 0

    def look(self, front_end: FrontEnd) -> Preview | None:
        """The preview that is `wanted`, if any, which is then no longer wanted."""
        t, self.wanted = self.wanted, None
        segment = None if t is None or not self.asked or front_end.fleeting else front_end.so_far()
        return None if t is None or segment is None else self.preview(front_end, segment, t, drafted=False)

    def preview(self, front_end: FrontEnd, segment: Segment, t: float, *, drafted: bool) -> Preview:
        """The preview of a segment of the open contact, at `t` s."""
        hole_s = front_end.cutter.hole(segment.onset, segment.offset, t)
        return Preview(
            segment, t, not front_end.segmenter.phase.let_go, drafted, front_end.segmenter.first is not None, hole_s
        )

    def wants(self, preview: Preview, certainty: Certainty, gestures: Iterable[str]) -> bool:
        """Whether one of these gestures could be said now by a model that is sure of it; else it need not look."""
        if self._said is None and any(self._needed(preview, certainty, name) is not None for name in gestures):
            return True
        self._row = 0
        return False

    def say(
        self, preview: Preview, certainty: Certainty, best: str, confidence: float, least: float
    ) -> Provisional | None:
        """The provisional event of a preview, if `best` is sure enough. `least`: the confidence needed at any time."""
        needed = self._needed(preview, certainty, best)
        if needed is None or not confidence >= max(needed, least):  # NaN is not enough either
            self._row = 0
            return None
        self._row = self._row + 1 if best == self._best else 1
        self._best = best
        if preview.down and self._row < certainty.in_a_row:
            return None
        self._said = Provisional(self._sensor, self._id, best, confidence, preview.segment.onset, preview.t)
        return self._said

    def judged(self, answer: Answer) -> Answer:
        """The answer of a contact, with whether it confirms or revokes its provisional event. No more looks follow."""
        said, self.wanted = self._said, None
        if said is None or said.id != answer.id:
            return answer
        right = isinstance(answer, Gesture) and answer.gesture == said.gesture
        return replace(answer, provisional="confirmed" if right else "revoked")

    def _needed(self, preview: Preview, certainty: Certainty, gesture: str) -> float | None:
        """The confidence that a gesture needs to be said now, None if it cannot be said now.

        One tap can be said only once the finger has left, since a finger that is down may still do anything. During a
        second contact only a double tap can be said, since any other gesture would be a segment of its own.
        """
        if not preview.down:
            return certainty.tap if gesture == ONE_TAP and self.taps and not preview.second else None
        if gesture == ONE_TAP or (gesture == DOUBLE_TAP) != preview.second:
            return None
        return certainty.needed(gesture, preview.t - preview.segment.onset)
