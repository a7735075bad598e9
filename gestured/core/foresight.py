"""What is said of a contact before its answer, and when that is sure enough.

A provisional event is no answer: the gesture, unknown or cancelled of the same id that follows confirms or revokes it.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

from gestured.core.certainty import Certainty
from gestured.core.events import Cancelled, Gesture, Provisional, Unknown
from gestured.core.found import Preview
from gestured.core.scene import DOUBLE_TAP, ONE_TAP

Answer = TypeVar("Answer", bound=Gesture | Unknown | Cancelled)


class Foresight:
    """What was said of the contact that goes on: at most one provisional event for each id."""

    def __init__(self, sensor: str, *, taps: bool) -> None:
        """`taps`: whether one tap is said before a second one may come."""
        self._sensor, self.taps = sensor, taps
        self._said: Provisional | None = None
        self._id = 0
        self._best = ""  # what the last frames were sure enough of
        self._row = 0  # how many of them in a row

    def open(self, preview: Preview, certainty: Certainty, gestures: Iterable[str]) -> bool:
        """Whether anything can be said now, of these gestures, if the model is sure enough; else it need not look."""
        if preview.id != self._id:
            self._id, self._said, self._row = preview.id, None, 0
        if self._said is None and any(self._needed(preview, certainty, name) is not None for name in gestures):
            return True
        self._row = 0
        return False

    def see(
        self, preview: Preview, certainty: Certainty, best: str, confidence: float, least: float
    ) -> Provisional | None:
        """What is to be said now that a model has looked. `least`: the confidence that an answer would need."""
        needed = self._needed(preview, certainty, best)
        if needed is None or not confidence >= max(needed, least):  # NaN is not enough either
            self._row = 0
            return None
        self._row = self._row + 1 if best == self._best else 1
        self._best = best
        if preview.down and self._row < certainty.in_a_row:
            return None
        self._said = Provisional(self._sensor, preview.id, best, confidence, preview.segment.onset, preview.t)
        return self._said

    def judged(self, answer: Answer) -> Answer:
        """The answer of a contact, with what became of what was said of it."""
        said = self._said
        if said is None or said.id != answer.id:
            return answer
        right = isinstance(answer, Gesture) and answer.gesture == said.gesture
        return replace(answer, provisional="confirmed" if right else "revoked")

    def _needed(self, preview: Preview, certainty: Certainty, gesture: str) -> float | None:
        """The confidence that a gesture needs to be said now, None where it is not.

        A finger that has just come down may still become anything, so it is a tap only once it has left. A second
        contact that is no tap will be none of this one: there, two taps are all that can be said.
        """
        if not preview.down:
            return certainty.tap if gesture == ONE_TAP and self.taps and not preview.second else None
        if gesture == ONE_TAP or (gesture == DOUBLE_TAP) != preview.second:
            return None
        return certainty.needed(gesture, preview.t - preview.segment.onset)
