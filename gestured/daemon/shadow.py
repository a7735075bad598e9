"""A candidate model beside the active one: it sees the same segments, and publishes nothing."""

from collections import Counter
from typing import Any

from gestured.core.frames import Segment
from gestured.core.recognizer import Classifier, Scores

PAIRS = 10  # disagreements that a report names
UNKNOWN = "unknown"


class Shadow:
    """Counts how a candidate answers what the active model answered. Costs one more inference a segment."""

    def __init__(self, candidate: Classifier, name: str) -> None:
        self.candidate, self.name = candidate, name
        self.segments = self.agreed = self.failed = 0
        self._confidence = [0.0, 0.0]  # sums, of the active one and of the candidate
        self._pairs: Counter[tuple[str, str]] = Counter()

    def see(self, segment: Segment, active: Scores) -> None:
        """Let the candidate answer, too; whatever it dies of is a failure of its own."""
        self.segments += 1
        try:
            ours, theirs = (answer(self.candidate, s) for s in (active, self.candidate.classify(segment)))
        except Exception:
            self.failed += 1
            return
        self._confidence[0] += ours[1]
        self._confidence[1] += theirs[1]
        if ours[0] == theirs[0]:
            self.agreed += 1
        else:
            self._pairs[ours[0], theirs[0]] += 1

    def report(self) -> dict[str, Any]:
        """Agreement and mean confidence; both None before there was anything to compare."""
        compared = self.segments - self.failed
        mean = [round(total / compared, 4) if compared else None for total in self._confidence]
        return {
            "model": self.name,
            "segments": self.segments,
            "failed": self.failed,
            "agreement": round(self.agreed / compared, 4) if compared else None,
            "confidence": mean[1],
            "active_confidence": mean[0],
            "disagreements": [
                {"active": ours, "candidate": theirs, "count": count}
                for (ours, theirs), count in self._pairs.most_common(PAIRS)
            ],
        }


def answer(model: Classifier, scores: Scores) -> tuple[str, float]:
    """(gesture or "unknown", confidence of the best gesture) by the model's own calibration."""
    confidence = scores.confidence
    best = model.gestures[int(scores.values.argmax())]
    return (best if confidence >= scores.threshold else UNKNOWN), confidence
