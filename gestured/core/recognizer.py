"""The one path from frames to events: conditioning, segmentation, classification, decision."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from gestured.core.classifier import Classifier, Foreseer, Scores
from gestured.core.errors import ModelError
from gestured.core.events import Cancelled, Event, Gesture, Provisional, Unknown
from gestured.core.facts import Decided
from gestured.core.foresight import Foresight
from gestured.core.found import Cut, Draft, Found, Preview
from gestured.core.frames import Frame, Segment
from gestured.core.front_end import FrontEnd
from gestured.core.holes import bearable_s
from gestured.core.pace import outside
from gestured.core.prototypes import NEAR, Match


class Recognizer:
    """Frames of one sensor in, events out, and what was decided. `classifier` may be replaced between two frames.

    `gestures` restricts the answer to a subset; what falls to the others is not given to those that are left.
    `thresholds` are the confidences below which a gesture is unknown, where not the model's own is to hold.
    `refractory` are the seconds in which the same gesture is not published again.

    What is not sure enough, or has a hole in which the finger may have moved unseen, is unknown. A gesture of the
    user's own may take what the model does not know, and what is much nearer to it than to the model's gestures.

    The classifier is asked while the segmenter still waits whether the finger stays off: once it is sure, the answer
    is there. Where the finger comes back, that answer is thrown away.

    Where the front end shows contacts before they are over, the classifier is asked about them as well, and what it is
    sure of is a provisional event. `foresight` remembers what was said, and changes nothing else.
    """

    def __init__(
        self,
        front_end: FrontEnd,
        classifier: Classifier,
        *,
        gestures: Sequence[str] | None = None,
        thresholds: Mapping[str, float] | None = None,
        refractory: Mapping[str, float] | None = None,
        foresight: Foresight | None = None,
        sequence: int = 0,
    ) -> None:
        self.front_end = front_end
        self.classifier = classifier
        self.sequence = sequence
        self._gestures = None if gestures is None else frozenset(gestures)
        self._thresholds = dict(thresholds or {})
        self._refractory = dict(refractory or {})
        self._last_offset: dict[str, float] = {}
        self._foresight = foresight or Foresight(front_end.sensor, taps=True)
        self._asked: tuple[Classifier, Segment, Scores | None] | None = None  # no scores where it failed

    def push(self, frame: Frame) -> list[Event | Decided]:
        """Take one frame, give what it decides; see `FrontEnd.push`."""
        found = self.front_end.push(frame)
        return self._name(found) if found else []

    @property
    def due(self) -> float | None:
        """When `wait` will have an answer unless a frame comes before; see `FrontEnd.due`."""
        return self.front_end.due

    def wait(self, t: float) -> list[Event | Decided]:
        """No frame has come until `t` s; see `FrontEnd.wait`."""
        return self._name(self.front_end.wait(t))

    def give_up(self, t: float) -> list[Event | Decided]:
        """Cancel a contact that goes on; see `FrontEnd.give_up`."""
        return self._name(self.front_end.give_up(t))

    def flush(self, t: float) -> list[Event | Decided]:
        """The stream paused or ended at `t` s: decide what can be decided, cancel the rest."""
        return self._name(self.front_end.flush(t))

    def reset(self) -> list[Event | Decided]:
        """The sensor restarted: cancel what is open, learn the idle sensor anew."""
        return self._name(self.front_end.reset())

    def _name(self, found: Sequence[Found]) -> list[Event | Decided]:
        out: list[Event | Decided] = []
        for one in found:
            if isinstance(one, Draft):
                self._ask(one.segment)
            elif isinstance(one, Preview):
                out += self._foresee(one)
            elif isinstance(one, Cut):
                answer, *decided = self._decide(one)
                out += [self._foresight.judged(answer), *decided]
            else:
                out.append(self._foresight.judged(one) if isinstance(one, Cancelled) else one)
        return out

    def _foresee(self, preview: Preview) -> list[Provisional]:
        """What can be said of a contact that is not over."""
        classifier, foresight = self.classifier, self._foresight
        if not isinstance(classifier, Foreseer) or (certainty := classifier.certainty) is None:
            return []
        in_use = classifier.gestures if self._gestures is None else self._gestures
        if not self._whole(preview.hole_s) or not foresight.open(preview, certainty, in_use):
            return []
        answer = self._ask(preview.segment) if preview.drafted else classifier.preview(preview.segment)
        if answer is None:
            return []
        _, best, confidence = self._best(answer)
        least = self._threshold(best, answer)
        held = self._refractory_for(best, preview.segment) or self._is_own(answer.own, confidence >= least)
        said = foresight.see(preview, certainty, best, confidence, math.inf if held else least)
        return [] if said is None else [said]

    def _ask(self, segment: Segment) -> Scores | None:
        """The classifier is asked once for each segment."""
        classifier, asked = self.classifier, self._asked
        if asked is None or asked[0] is not classifier or asked[1] is not segment:
            try:
                asked = classifier, segment, classifier.classify(segment)
            except ModelError:
                asked = classifier, segment, None
            self._asked = asked
        return asked[2]

    def _decide(self, cut: Cut) -> tuple[Gesture | Unknown | Cancelled, *tuple[Decided, ...]]:
        """The answer, and what was decided, where a model could."""
        sensor, segment = self.front_end.sensor, cut.segment
        answer = self._ask(segment)
        self._asked = None
        if answer is None:
            return (Cancelled(sensor, cut.id, "model"),)
        scores, best, confidence = self._best(answer)
        whole = self._whole(cut.hole_s)
        known = whole and confidence >= self._threshold(best, answer)
        decided = Decided(sensor, segment, answer, known)
        own = answer.own if whole and self._is_own(answer.own, known) else None
        if own is not None:
            best, confidence = own.name, own.confidence
        what = (
            segment.onset, segment.offset, cut.decided, segment.last - segment.first + 1, segment.lost,
            answer.model, answer.degraded, scores,
        )  # fmt: skip
        if not known and own is None:
            return Unknown(sensor, cut.id, confidence, *what, reason=self._reason(whole)), decided
        if self._refractory_for(best, segment):
            return Cancelled(sensor, cut.id, "refractory"), decided
        self._last_offset[best] = segment.offset
        self.sequence += 1
        return Gesture(sensor, cut.id, best, confidence, self.sequence, *what, own=own is not None), decided

    def _best(self, answer: Scores) -> tuple[dict[str, float], str, float]:
        """The scores of the gestures in use, the best of them, and how sure it is."""
        scores = {
            gesture: float(value)
            for gesture, value in zip(self.classifier.gestures, answer.values, strict=True)
            if self._gestures is None or gesture in self._gestures
        }
        best = max(scores, key=scores.__getitem__)
        return scores, best, scores[best] * (1.0 - answer.unknown)

    def _threshold(self, gesture: str, answer: Scores) -> float:
        """The confidence from which an answer is that gesture."""
        return self._thresholds.get(gesture, answer.threshold)

    def _whole(self, hole_s: float) -> bool:
        """Whether the longest time without a frame is too short for the finger to have moved unseen."""
        return hole_s <= bearable_s(self.front_end.interval_s)

    def _reason(self, whole: bool) -> str:
        """Why a segment is unknown; a sensor that is too slow or too fast explains it first."""
        if outside(self.front_end.rate_hz):
            return "rate"
        return "confidence" if whole else "hole"

    def _refractory_for(self, gesture: str, segment: Segment) -> bool:
        """Whether it is too early to publish that gesture again."""
        since = segment.onset - self._last_offset.get(gesture, -np.inf)
        return bool(since < self._refractory.get(gesture, 0.0))

    def _is_own(self, match: Match | None, known: bool) -> bool:
        """Whether a gesture of the user's own may have a segment; `known`: the model would have it, too."""
        if match is None or (known and not match.nearer):
            return False
        return match.confidence >= self._thresholds.get(match.name, NEAR)
