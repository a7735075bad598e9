"""What was performed beside what was recognised: matching by time, and the tally. Times are epoch seconds."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Any

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


@dataclass
class Tally:
    """Feed it what was performed (`begin`), events as they arrive (`hear`) and the time (`settle`)."""

    waiting: list[Performed] = field(default_factory=list)
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("right", "wrong", "missed", "rejected", "false"), 0)
    )
    latencies: list[float] = field(default_factory=list)

    def begin(self, performed: Performed) -> None:
        """Something is being performed; its end may still lie ahead."""
        self.waiting.append(performed)

    def hear(self, event: Mapping[str, Any], arrived: float) -> Outcome | None:
        """An event of type gesture or unknown; an unknown decides nothing yet, a gesture may still follow."""
        performed = self._match(event["onset"], event["offset"])
        if event["type"] == "unknown":
            if performed:
                performed.unknown = True
            return None
        if performed is None or performed.answered or performed.label == NONE:
            if performed:
                performed.answered = True
            return self._count(Outcome("false", performed, event))
        performed.answered = True
        verdict = "right" if event["gesture"] == performed.label else "wrong"
        latency = arrived - performed.offset
        self.latencies.append(latency)
        return self._count(Outcome(verdict, performed, event, latency))

    def settle(self, now: float) -> list[Outcome]:
        """What nothing can come for any more."""
        over = [performed for performed in self.waiting if performed.offset + MISSED_AFTER_S <= now]
        self.waiting = [performed for performed in self.waiting if performed not in over]
        silent = [performed for performed in over if not performed.answered]
        return [self._count(Outcome("rejected" if p.label == NONE else "missed", p)) for p in silent]

    def summary(self) -> dict[str, Any]:
        """The counts, and the latency in milliseconds (None where there is none)."""
        ordered = sorted(self.latencies)
        return self.counts | {
            "latency_ms_median": round(1000 * median(ordered)) if ordered else None,
            "latency_ms_p95": round(1000 * ordered[int(0.95 * len(ordered))]) if ordered else None,
        }

    def _match(self, onset: float, offset: float) -> Performed | None:
        def overlap(performed: Performed) -> float:
            return min(offset, performed.offset) - max(onset, performed.onset)

        best = max(self.waiting, key=overlap, default=None)
        return best if best and overlap(best) > -TOLERANCE_S else None

    def _count(self, outcome: Outcome) -> Outcome:
        self.counts[outcome.verdict] += 1
        return outcome
