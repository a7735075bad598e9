"""What a recording's events and those of its replay have in common, and where they differ."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Mapping
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

from gestured.client.say import shown
from gestured.control.show import clock
from gestured.record.replay import opened

ONSET_S = 0.25  # answers whose onsets lie closer are about the same contact
CONFIDENCE_TOLERANCE = 0.05  # what a baseline learned at another moment may change

Line = Mapping[str, Any]  # of the event stream; its times are the recording's
Knew = Callable[[str, float], bool]  # whether a sensor's idle state was known at a time (s)


class Answer(NamedTuple):
    """What became of one contact."""

    sensor: str
    onset: float  # s since the epoch, or on a stopwatch
    answer: str  # a gesture, "unknown", or "cancelled: " and the reason
    confidence: float | None

    def words(self) -> str:
        """The answer as a line that a person reads."""
        sure = "" if self.confidence is None else f" {self.confidence:.3f}"
        return f"{clock(self.onset)} {self.sensor}: {self.answer}{sure}"


class Difference(NamedTuple):
    """One contact that was answered differently; None where one side has no such contact."""

    recorded: Answer | None
    replayed: Answer | None

    @property
    def names(self) -> tuple[str, str]:
        """What was recorded and what the replay says, without how sure; "nothing" for a side without the contact."""
        recorded, replayed = ("nothing" if one is None else one.answer for one in self)
        return recorded, replayed

    def words(self) -> str:
        """For a person: `-` is what was recorded, `+` what the replay says."""
        return "\n".join(
            shown(f"{sign} {one.words()}") for sign, one in zip("-+", self, strict=True) if one is not None
        )


Verdict = tuple[str, int, list[Difference]]  # what was compared, how many were not, and where it differs


class Recorded:
    """What `gesturectl record` or `flag` wrote. Raises RecordingError."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tape, self.maker = opened(path)

    def compare(self, lines: Iterable[Line], knew: Knew) -> Verdict:
        """Hold the events of a replay against those that were recorded."""
        before = answers(self.tape.events)
        usable = [answer for answer in before if knew(answer.sensor, answer.onset)]
        # A daemon that knew the sensor from before answers earlier: that was not asked.
        after = [answer for answer in answers(lines) if knew(answer.sensor, answer.onset)]
        return f"{len(usable)} recorded answers", len(before) - len(usable), differences(usable, after)


def answers(lines: Iterable[Line]) -> list[Answer]:
    """The answers among the lines of an event stream."""
    onsets: dict[tuple[str, int], float] = {}
    found = []
    for line in lines:
        key = line.get("sensor", ""), line.get("id", 0)
        if line["type"] == "onset":
            onsets[key] = line["onset"]
        elif line["type"] in ("gesture", "unknown"):
            name = line.get("gesture", "unknown")
            found.append(Answer(key[0], line["onset"], name, line["confidence"]))
        elif line["type"] == "cancelled" and key in onsets:
            found.append(Answer(key[0], onsets[key], f"cancelled: {line['reason']}", None))
    return found


def differences(before: Iterable[Answer], after: Iterable[Answer]) -> list[Difference]:
    """Contacts are matched by their onsets; what is alike on both sides is left out."""
    by_onset = attrgetter("onset")
    rest = sorted(after, key=by_onset)
    found = []
    for old in sorted(before, key=by_onset):
        first = bisect_left(rest, old.onset - ONSET_S, key=by_onset)
        last = bisect_right(rest, old.onset + ONSET_S, key=by_onset)
        near = [new for new in rest[first:last] if new.sensor == old.sensor]
        new = min(near, key=lambda answer: abs(answer.onset - old.onset), default=None)
        if new is not None:
            rest.remove(new)
        if new is None or not _alike(old, new):
            found.append(Difference(old, new))
    return [*found, *(Difference(None, new) for new in rest)]


def _alike(old: Answer, new: Answer) -> bool:
    before, after = old.confidence, new.confidence
    sure = before is None or after is None or abs(before - after) <= CONFIDENCE_TOLERANCE
    return sure and old.answer == new.answer
