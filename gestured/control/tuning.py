"""Thresholds, by what they cost on recordings: gestures lost and wrong, and events that nobody meant.

A recording is played once; at every threshold it is only counted again.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gestured.record.judge import NONE, Performed, owners, verdict

THRESHOLDS = tuple(round(0.05 * k, 2) for k in range(1, 20))
ENOUGH = 20  # performances of a gesture before anything is proposed for it alone
FALSE_AN_HOUR = 1.0  # false gestures that a proposal may cost at most, where recordings hold no gestures to lose


@dataclass(frozen=True)
class Said:
    """What the model would have published of one contact, were it sure enough."""

    gesture: str
    confidence: float
    performed: Performed | None  # what was performed then


@dataclass
class Played:
    """All that was performed, and all that was said, in their order."""

    performed: list[Performed] = field(default_factory=list)  # gestures alone
    others: int = 0  # non-gestures
    said: list[Said] = field(default_factory=list)
    skipped: int = 0  # performed before the sensor was known
    seconds: float = 0.0

    def add(self, performed: Iterable[Performed], events: Iterable[Mapping[str, Any]]) -> None:
        """What one recording holds, and its events in their order, published from no confidence at all."""
        asked = sorted(performed, key=lambda one: one.onset)
        self.performed += [one for one in asked if one.label != NONE]
        self.others += sum(one.label == NONE for one in asked)
        said = list(events)
        spans = [(float(event["onset"]), float(event["offset"])) for event in said]
        for event, performed_then in zip(said, owners(spans, asked), strict=True):
            self.said.append(Said(str(event["gesture"]), float(event["confidence"]), performed_then))


@dataclass(frozen=True)
class Counts:
    """What a threshold costs."""

    threshold: float
    right: int
    wrong: int
    missed: int
    false: int

    def cost(self, each: float) -> float:
        """In gestures that are missed; a wrong or a false one costs as much as `each` of them."""
        return self.missed + each * (self.wrong + self.false)


def counted(played: Played, threshold: float, gesture: str | None = None) -> Counts:
    """Count the answers that are right, wrong, missed or false at one threshold.

    With `gesture`, performances of that gesture can be right or missed, and answers that name it wrong or false.
    """
    answered: dict[int, bool] = {}  # performed -> whether rightly
    wrong = false = 0
    for said in played.said:
        if said.confidence < threshold:
            continue
        found = verdict(said.gesture, said.performed, answered=id(said.performed) in answered)
        if found != "false":
            answered[id(said.performed)] = found == "right"
        if gesture in (None, said.gesture):
            wrong, false = wrong + (found == "wrong"), false + (found == "false")
    own = [one for one in played.performed if gesture in (None, one.label)]
    right = sum(answered.get(id(one), False) for one in own)
    lost = len(own) - right if gesture else sum(id(one) not in answered for one in own)
    return Counts(threshold, right, wrong, lost, false)


def proposed(rows: Sequence[Counts], played: Played, each: float, now: float) -> Counts:
    """The row that costs least; of equal ones that nearest to what is set `now`.

    Without gestures there is nothing to lose: then the lowest with few enough false ones, or the highest.
    """
    if not played.performed:
        quiet = [row for row in rows if row.false <= FALSE_AN_HOUR * played.seconds / 3600]
        return (quiet or rows[-1:])[0]  # their thresholds rise
    return min(rows, key=lambda row: (row.cost(each), abs(row.threshold - now)))


def for_each(played: Played, each: float, now: float) -> dict[str, Counts]:
    """What is proposed for single gestures: those that were performed often enough."""
    performed = Counter(one.label for one in played.performed)
    return {
        name: proposed([counted(played, t, name) for t in THRESHOLDS], played, each, now)
        for name, count in sorted(performed.items())
        if count >= ENOUGH
    }
