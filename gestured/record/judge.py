"""Who performed what, and who said what: one rule, one tolerance, and the words for how it went.

What was said belongs to the performance that it overlaps most in time, if it lies within TOLERANCE_S of it. The first
gesture that is said of a performance decides: `right` or `wrong`. Another one of the same performance, one of no
performance, and one of what is no gesture are `false`. A gesture of which none was said is `missed`, also called lost.
Times are seconds on any clock that both sides share.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any, Protocol, TypeVar

LEAST = 20  # gestures, of which percentiles say something
NONE = "none"  # the label of whatever is no gesture
TOLERANCE_S = 0.3  # clocks, filters and thresholds shift an onset by some frames
REACH_S = 2 * TOLERANCE_S  # what lies farther away belongs to something else, however the times were rounded
MISSED_AFTER_S = 1.5  # after the end of what was performed; longer than any wait for a second tap


class Act(Protocol):
    """Something that was performed, as any room writes it down."""

    @property
    def label(self) -> str:
        """A gesture, or NONE."""

    @property
    def onset(self) -> float:
        """When it began, in s."""

    @property
    def offset(self) -> float:
        """When it ended, in s."""


A = TypeVar("A", bound=Act)


def whose(onset: float, offset: float, performed: Iterable[A]) -> A | None:
    """The performance to which what was said of `onset` to `offset` (s) belongs; None for none."""

    def overlap(act: A) -> float:
        return min(offset, act.offset) - max(onset, act.onset)

    best = max(performed, key=overlap, default=None)
    return best if best is not None and overlap(best) > -TOLERANCE_S else None


def owners(spans: Sequence[tuple[float, float]], performed: Iterable[A]) -> list[A | None]:
    """Whose each (onset, offset) in s is, as `whose` has it, where there are too many to look at all."""
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
    """How a gesture that was said of `act` went: "right", "wrong" or "false". `answered`: one was said of it before."""
    if act is None or answered or act.label == NONE:
        return "false"
    return "right" if gesture == act.label else "wrong"


@dataclass(eq=False)
class Performed:
    """What the person at the sensor did."""

    label: str  # a gesture, or "none"
    kind: str  # the finer name
    onset: float
    offset: float
    answered: bool = False
    unknown: bool = False  # the daemon saw it, and called it unknown


@dataclass(frozen=True)
class Said:
    """What a model would have published of one contact, were it sure enough."""

    gesture: str
    confidence: float
    performed: Performed | None  # what was performed then


def verdicts(said: Iterable[Said], least: float | Mapping[str, float]) -> Iterator[tuple[Said, str]]:
    """What is published at a threshold, or at one for each gesture, of what is said in order; and how each went."""
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
    """One thing that was performed, or recognised, or both; `verdict` says how that went.

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
    """Feed it what was performed (`begin`), events as they arrive (`hear`) and the time (`settle`)."""

    waiting: list[Performed] = field(default_factory=list)
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("right", "wrong", "missed", "rejected", "false"), 0)
    )
    latencies: list[float] = field(default_factory=list)
    given: int = 0  # provisional events
    leads: list[float] = field(default_factory=list)  # s from each that was confirmed to the last touched frame
    _early: Mapping[str, Any] | None = None  # the last one

    def begin(self, performed: Performed) -> None:
        """Something is being performed; its end may still lie ahead."""
        self.waiting.append(performed)

    def hear(self, event: Mapping[str, Any], arrived: float) -> Outcome | None:
        """A gesture, unknown or provisional event; the last two decide nothing yet, a gesture may still follow."""
        if event["type"] == "provisional":
            self.given, self._early = self.given + 1, event
            return None
        return self.judge(event, arrived, whose(event["onset"], event["offset"], self.waiting))

    def judge(self, event: Mapping[str, Any], arrived: float, performed: Performed | None) -> Outcome | None:
        """The same for a gesture or unknown event, where it is known already to what it belongs."""
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
        """What nothing can come for any more."""
        over = [performed.offset + MISSED_AFTER_S <= now for performed in self.waiting]
        silent = [one for one, late in zip(self.waiting, over, strict=True) if late and not one.answered]
        self.waiting = [one for one, late in zip(self.waiting, over, strict=True) if not late]
        return [self._count(Outcome("rejected" if p.label == NONE else "missed", p)) for p in silent]

    def summary(self) -> dict[str, Any]:
        """The counts, latency and lead in milliseconds (None where too few, or none); provisional events."""
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
    """All that was performed, and all gestures and unknowns that were said of it, once it is over.

    The outcomes are those of the events, in their order, and then of what nothing was said of.
    """
    tally, heard = Tally(list(performed)), list(events)
    belongs = owners([(event["onset"], event["offset"]) for event in heard], performed)
    told = [tally.judge(event, event["decided"], act) for event, act in zip(heard, belongs, strict=True)]
    return tally, [outcome for outcome in told if outcome] + tally.settle(math.inf)
