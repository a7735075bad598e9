"""The judge: gestures that were performed, compared with the events about them, by one rule and one tolerance.

An event belongs to the performance that it overlaps most in time, if it lies within TOLERANCE_S of that. One that
nobody named comes last: a finger that goes on touching after a swipe makes one contact of both. The first gesture event
of a performance is `right` or `wrong`. A further one, one without a performance, and one of a performance that is no
gesture are `false`. A performed gesture without a gesture event is `missed`, also called lost. Times are seconds on any
clock that performances and events share.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any, Protocol, TypeVar

LEAST = 20  # gestures, from which on percentiles are given
NONE = "none"  # the label of whatever is no gesture
UNNAMED = "other"  # the label of a performance of which nobody knows the gesture
TOLERANCE_S = 0.3  # clocks, filters and thresholds shift an onset by some frames
REACH_S = 2 * TOLERANCE_S  # an event farther away cannot belong to a performance, however the times were rounded
MISSED_AFTER_S = 1.5  # after the end of a performance; longer than any wait for a second tap


class Act(Protocol):
    """A performance, in any class that has these attributes."""

    @property
    def label(self) -> str:
        """The gesture, or NONE."""

    @property
    def onset(self) -> float:
        """When the performance began, in s."""

    @property
    def offset(self) -> float:
        """When the performance ended, in s."""


A = TypeVar("A", bound=Act)


def whose(onset: float, offset: float, performed: Iterable[A]) -> A | None:
    """The performance to which an event from `onset` to `offset` (s) belongs; None if there is none."""

    def overlap(act: A) -> float:
        return min(offset, act.offset) - max(onset, act.onset)

    best = max(performed, key=lambda act: (overlap(act) > 0.0 and act.label != UNNAMED, overlap(act)), default=None)
    return best if best is not None and overlap(best) > -TOLERANCE_S else None


def owners(spans: Sequence[tuple[float, float]], performed: Iterable[A]) -> list[A | None]:
    """The performance of each event (onset, offset) in s, as `whose` finds it, but faster for many."""
    ahead = deque(sorted(enumerate(performed), key=lambda one: one[1].onset))
    near: dict[int, A] = {}  # by place in `performed`, whose order decides between two that overlap as much
    found: list[A | None] = [None] * len(spans)
    for n in sorted(range(len(spans)), key=lambda n: spans[n][0]):
        onset, offset = spans[n]
        while ahead and ahead[0][1].onset < offset + REACH_S:
            place, act = ahead.popleft()
            near[place] = act
        near = {place: act for place, act in near.items() if act.offset > onset - REACH_S}
        found[n] = whose(onset, offset, [near[place] for place in sorted(near)])
    return found


def verdict(gesture: str, act: Act | None, *, answered: bool) -> str:
    """The verdict on a gesture event of `act`: "right", "wrong" or "false". `answered`: whether it is a further one."""
    if act is None or answered or act.label == NONE:
        return "false"
    return "right" if gesture == act.label else "wrong"


@dataclass(eq=False)
class Performed:
    """A performance: what the person at the sensor did."""

    label: str  # a gesture, or "none"
    kind: str  # a finer name than the label
    onset: float  # s
    offset: float  # s
    answered: bool = False  # whether it had a gesture event
    unknown: bool = False  # whether it had an unknown event


@dataclass(frozen=True)
class Said:
    """The gesture that a model would publish for one contact if it were sure enough."""

    gesture: str
    confidence: float
    performed: Performed | None  # the performance of the contact


def verdicts(said: Iterable[Said], least: float | Mapping[str, float]) -> Iterator[tuple[Said, str]]:
    """Those of `said`, in order, that reach a threshold (one for all, or one by gesture), with their verdicts."""
    answered: set[int] = set()
    for one in said:
        if one.confidence < (least[one.gesture] if isinstance(least, Mapping) else least):
            continue
        found = verdict(one.gesture, one.performed, answered=id(one.performed) in answered)
        if found != "false":
            answered.add(id(one.performed))
        yield one, found


@dataclass(frozen=True)
class Outcome:
    """A performance, an event, or both, and the verdict on them.

    right: the gesture that was performed; wrong: another one; missed: a gesture without an event;
    rejected: no gesture, and no event; false: an event without a gesture.
    """

    verdict: str
    performed: Performed | None
    event: Mapping[str, Any] | None = None
    latency_s: float | None = None  # the event's arrival minus the performed end
    early: Mapping[str, Any] | None = None  # the provisional event before it


@dataclass
class Tally:
    """A tally of outcomes, from performances (`begin`), events as they arrive (`hear`) and the time (`settle`)."""

    waiting: list[Performed] = field(default_factory=list)
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("right", "wrong", "missed", "rejected", "false"), 0)
    )
    latencies: list[float] = field(default_factory=list)
    given: int = 0  # provisional events
    leads: list[float] = field(default_factory=list)  # s from confirmed provisional events to the last touched frame
    _early: Mapping[str, Any] | None = None  # the last provisional event

    def begin(self, performed: Performed) -> None:
        """Take a performance, whose end may still lie ahead."""
        self.waiting.append(performed)

    def hear(self, event: Mapping[str, Any], arrived: float) -> Outcome | None:
        """Take an event; only a gesture has an outcome, since one may still follow an unknown or provisional event."""
        if event["type"] == "provisional":
            self.given, self._early = self.given + 1, event
            return None
        return self.judge(event, arrived, whose(event["onset"], event["offset"], self.waiting))

    def judge(self, event: Mapping[str, Any], arrived: float, performed: Performed | None) -> Outcome | None:
        """Take a gesture or unknown event that belongs to `performed`; returns the outcome of a gesture."""
        early = self._early if event.get("provisional") else None
        if early is not None and event["provisional"] == "confirmed":
            self.leads.append(event["offset"] - early["decided"])
        if event["type"] == "unknown":
            if performed:
                performed.unknown = True
            return None
        found = verdict(event["gesture"], performed, answered=performed is not None and performed.answered)
        if performed is not None:
            performed.answered = True
        if performed is None or found == "false":
            return self._count(Outcome(found, performed, event, early=early))
        latency = arrived - performed.offset
        self.latencies.append(latency)
        return self._count(Outcome(found, performed, event, latency, early))

    def settle(self, now: float) -> list[Outcome]:
        """The outcomes of the performances without a gesture event for which none can come any more at `now` (s)."""
        over = [performed.offset + MISSED_AFTER_S <= now for performed in self.waiting]
        silent = [one for one, late in zip(self.waiting, over, strict=True) if late and not one.answered]
        self.waiting = [one for one, late in zip(self.waiting, over, strict=True) if not late]
        return [self._count(Outcome("rejected" if p.label == NONE else "missed", p)) for p in silent]

    def summary(self) -> dict[str, Any]:
        """The counts, the numbers of provisional events, and latency and lead in ms (None if there are too few)."""
        ordered = sorted(self.latencies) if len(self.latencies) >= LEAST else []
        return self.counts | {
            "latency_ms_median": round(1000 * median(ordered)) if ordered else None,
            "latency_ms_p95": round(1000 * ordered[int(0.95 * len(ordered))]) if ordered else None,
            "provisional": self.given,
            "confirmed": len(self.leads),
            "lead_ms_median": round(1000 * median(self.leads)) if self.leads else None,
        }

    def _count(self, outcome: Outcome) -> Outcome:
        self.counts[outcome.verdict] += 1
        return outcome


def tallied(performed: Sequence[Performed], events: Iterable[Mapping[str, Any]]) -> tuple[Tally, list[Outcome]]:
    """The tally of all performances and of all gesture and unknown events, after the last one.

    The outcomes are those of the events, in their order, and then those of performances without a gesture event.
    """
    tally, heard = Tally(list(performed)), list(events)
    belongs = owners([(event["onset"], event["offset"]) for event in heard], performed)
    told = [tally.judge(event, event["decided"], act) for event, act in zip(heard, belongs, strict=True)]
    return tally, [outcome for outcome in told if outcome] + tally.settle(math.inf)
