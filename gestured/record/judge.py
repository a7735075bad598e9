"""What was performed beside what was recognised: matching by time, and the tally. Times are epoch seconds."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Any

LEAST = 20  # gestures, of which percentiles say something
NONE = "none"  # the label of whatever is no gesture
TOLERANCE_S = 0.3  # clocks, filters and thresholds shift an onset by some frames
MISSED_AFTER_S = 1.5  # after the end of what was performed; longer than any wait for a second tap


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
        performed = self._match(event["onset"], event["offset"])
        early = self._early if event.get("provisional") else None
        if early is not None and event["provisional"] == "confirmed":
            self.leads.append(event["offset"] - early["decided"])
        if event["type"] == "unknown":
            if performed:
                performed.unknown = True
            return None
        if performed is None or performed.answered or performed.label == NONE:
            if performed:
                performed.answered = True
            return self._count(Outcome("false", performed, event, early=early))
        performed.answered = True
        verdict = "right" if event["gesture"] == performed.label else "wrong"
        latency = arrived - performed.offset
        self.latencies.append(latency)
        return self._count(Outcome(verdict, performed, event, latency, early))

    def settle(self, now: float) -> list[Outcome]:
        """What nothing can come for any more."""
        over = [performed for performed in self.waiting if performed.offset + MISSED_AFTER_S <= now]
        self.waiting = [performed for performed in self.waiting if performed not in over]
        silent = [performed for performed in over if not performed.answered]
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

    def _match(self, onset: float, offset: float) -> Performed | None:
        def overlap(performed: Performed) -> float:
            return min(offset, performed.offset) - max(onset, performed.onset)

        best = max(self.waiting, key=overlap, default=None)
        return best if best and overlap(best) > -TOLERANCE_S else None

    def _count(self, outcome: Outcome) -> Outcome:
        self.counts[outcome.verdict] += 1
        return outcome
