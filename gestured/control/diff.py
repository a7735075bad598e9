"""The comparison of a recording's events with those of its replay."""

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

from gestured.client.say import shown
from gestured.control.show import clock
from gestured.record.replay import opened

ONSET_S = 0.25  # answers whose onsets are at most so far apart are about the same contact
# These stand for answers that are not compared, since the recording ends before them, or since the replay had not yet
# learned the sensor.
OPEN, EARLY = "none so far", "before the sensor was known"
CONFIDENCE_TOLERANCE = 0.05  # a baseline that was learned at another moment may change a confidence by so much

Line = Mapping[str, Any]  # of the event stream, with the recording's times
Knew = Callable[[str, float], bool]  # whether the idle sensor of that name was known at a time (s)


class Answer(NamedTuple):
    """The answer to one contact."""

    sensor: str
    onset: float  # s since the epoch, or on a stopwatch
    answer: str  # a gesture, "unknown", or "cancelled: " and the reason
    confidence: float | None

    def words(self) -> str:
        """The answer as a line for a person."""
        sure = "" if self.confidence is None else f" {self.confidence:.3f}"
        return f"{clock(self.onset)} {self.sensor}: {self.answer}{sure}"


class Difference(NamedTuple):
    """One contact that was answered differently; None for a side without such a contact."""

    recorded: Answer | None
    replayed: Answer | None

    @property
    def names(self) -> tuple[str, str]:
        """The recorded and the replayed answer without confidences; "nothing" for a side without the contact."""
        recorded, replayed = ("nothing" if one is None else one.answer for one in self)
        return recorded, replayed

    def words(self) -> str:
        """The two answers in lines for a person: `-` is the recorded one, `+` the replayed one."""
        return "\n".join(
            shown(f"{sign} {one.words()}") for sign, one in zip("-+", self, strict=True) if one is not None
        )


Verdict = tuple[str, int, list[Difference]]  # what was compared, how many contacts were not, differences


class Recorded:
    """A tape that `gesturectl record` or `flag` wrote, to be compared with its replay. Raises RecordingError."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tape, self.maker = opened(path)

    def compare(self, lines: Iterable[Line], knew: Knew) -> Verdict:
        """Compare the events of a replay with the recorded ones."""
        # A daemon that knew the sensor before the recording began has answered contacts that a replay cannot answer.
        before = [
            answer if knew(answer.sensor, answer.onset) else answer._replace(answer=EARLY)
            for answer in answers(self.tape.events)
        ]
        after = [answer for answer in answers(lines) if knew(answer.sensor, answer.onset)]
        counts = Counter(answer.answer for answer in before)
        compared = len(before) - counts[EARLY] - counts[OPEN]
        return f"{compared} recorded answers", counts[EARLY], differences(before, after)


def answers(lines: Iterable[Line]) -> list[Answer]:
    """The answers among the lines of an event stream; last those to contacts that are still open at its end."""
    onsets: dict[tuple[str, int], float] = {}
    found = []
    for line in lines:
        key = line.get("sensor", ""), line.get("id", 0)
        if line["type"] == "onset":
            onsets[key] = line["onset"]
        elif line["type"] in ("gesture", "unknown"):
            name = line.get("gesture", "unknown")
            onsets.pop(key, None)
            found.append(Answer(key[0], line["onset"], name, line["confidence"]))
        elif line["type"] == "cancelled" and key in onsets:
            found.append(Answer(key[0], onsets.pop(key), f"cancelled: {line['reason']}", None))
    return found + [Answer(sensor, onset, OPEN, None) for (sensor, _), onset in onsets.items()]


def differences(before: Iterable[Answer], after: Iterable[Answer]) -> list[Difference]:
    """The contacts that were answered differently, matched by their onsets."""
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
        if old.answer not in (OPEN, EARLY) and (new is None or not _alike(old, new)):
            found.append(Difference(old, new))
    return [*found, *(Difference(None, new) for new in rest)]


def _alike(old: Answer, new: Answer) -> bool:
    before, after = old.confidence, new.confidence
    sure = before is None or after is None or abs(before - after) <= CONFIDENCE_TOLERANCE
    return sure and old.answer == new.answer
