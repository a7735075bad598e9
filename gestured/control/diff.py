"""What a recording's events and those of its replay have in common, and where they differ."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from gestured.core.events import Cancelled, Event, Gesture, Onset, Unknown

ONSET_S = 0.25  # answers whose onsets lie closer are about the same contact
CONFIDENCE = 0.05  # what a baseline learned at another moment may change


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of one contact."""

    sensor: str
    onset: float  # s since the epoch
    name: str  # a gesture, "unknown", or "cancelled: " and the reason
    confidence: float | None

    def words(self) -> str:
        """For a person."""
        clock = datetime.fromtimestamp(self.onset).strftime("%H:%M:%S.%f")[:-3]
        sure = "" if self.confidence is None else f" {self.confidence:.3f}"
        return f"{clock} {self.sensor}: {self.name}{sure}"


@dataclass(frozen=True, slots=True)
class Difference:
    """One contact that was answered differently; None where one side has no such contact."""

    recorded: Answer | None
    replayed: Answer | None

    def words(self) -> str:
        """For a person: `-` is what was recorded, `+` what the replay says."""
        sides = (("-", self.recorded), ("+", self.replayed))
        return "\n".join(f"{sign} {answer.words()}" for sign, answer in sides if answer is not None)


def recorded(lines: Iterable[Mapping[str, Any]]) -> list[Answer]:
    """The answers among the lines of an event stream."""
    onsets: dict[tuple[str, int], float] = {}
    answers = []
    for line in lines:
        key = line.get("sensor", ""), line.get("id", 0)
        if line["type"] == "onset":
            onsets[key] = line["onset"]
        elif line["type"] in ("gesture", "unknown"):
            name = line.get("gesture", "unknown")
            answers.append(Answer(key[0], line["onset"], name, line["confidence"]))
        elif line["type"] == "cancelled" and key in onsets:
            answers.append(Answer(key[0], onsets[key], f"cancelled: {line['reason']}", None))
    return answers


def replayed(events: Iterable[Event], epoch: float) -> list[Answer]:
    """The same of events; stream time + `epoch` s = time since the Unix epoch."""
    onsets: dict[tuple[str, int], float] = {}
    answers = []
    for event in events:
        match event:
            case Onset():
                onsets[event.sensor, event.id] = event.onset + epoch
            case Gesture():
                answers.append(Answer(event.sensor, event.onset + epoch, event.gesture, event.confidence))
            case Unknown():
                answers.append(Answer(event.sensor, event.onset + epoch, "unknown", event.confidence))
            case Cancelled():
                onset = onsets[event.sensor, event.id]
                answers.append(Answer(event.sensor, onset, f"cancelled: {event.reason}", None))
    return answers


def differences(before: Iterable[Answer], after: Iterable[Answer]) -> list[Difference]:
    """Contacts are matched by their onsets; what is alike on both sides is left out."""
    rest = sorted(after, key=lambda answer: answer.onset)
    found = []
    for old in sorted(before, key=lambda answer: answer.onset):
        near = [new for new in rest if new.sensor == old.sensor and abs(new.onset - old.onset) <= ONSET_S]
        new = min(near, key=lambda answer: abs(answer.onset - old.onset), default=None)
        if new is not None:
            rest.remove(new)
        if new is None or not _alike(old, new):
            found.append(Difference(old, new))
    return [*found, *(Difference(None, new) for new in rest)]


def _alike(old: Answer, new: Answer) -> bool:
    if old.name != new.name:
        return False
    return old.confidence is None or new.confidence is None or abs(old.confidence - new.confidence) <= CONFIDENCE
