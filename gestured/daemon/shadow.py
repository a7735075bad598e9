"""A candidate model beside the active one: it sees the same segments, and publishes nothing.

It runs in a process of its own (`model.process`), and a thread of ours waits for its answers. Nothing else waits for
it: segments for which it has no time are dropped and counted, and where it never answers it is ended.
"""

import queue
import threading
from collections import Counter
from typing import Any

from gestured.core.classifier import Classifier, Scores
from gestured.core.frames import Segment
from gestured.model.process import ModelProcess

PAIRS = 10  # disagreements that a report names
WAITING_SEGMENTS = 8  # segments; each may be some seconds of frames
FINISH_S = 2.0  # how long a candidate may take for the segments that it has when it is ended
UNKNOWN = "unknown"


class Comparison:
    """How often a candidate agreed with the active model."""

    def __init__(self) -> None:
        self.agreed = self.compared = 0
        self._confidence = [0.0, 0.0]  # sums, of the active one and of the candidate
        self._pairs: Counter[tuple[str, str]] = Counter()

    def add(self, active: tuple[str, float], candidate: tuple[str, float]) -> None:
        """One segment's two answers, each as `answer` gives it."""
        self.compared += 1
        self._confidence[0] += active[1]
        self._confidence[1] += candidate[1]
        if active[0] == candidate[0]:
            self.agreed += 1
        else:
            self._pairs[active[0], candidate[0]] += 1

    def report(self) -> dict[str, Any]:
        """Agreement and mean confidence; both None before there was anything to compare."""
        mean = [round(total / self.compared, 4) if self.compared else None for total in self._confidence]
        return {
            "agreement": round(self.agreed / self.compared, 4) if self.compared else None,
            "confidence": mean[1],
            "active_confidence": mean[0],
            "disagreements": [
                {"active": ours, "candidate": theirs, "count": count}
                for (ours, theirs), count in self._pairs.most_common(PAIRS)
            ],
        }


class Shadow:
    """A candidate at work, and what came of it so far."""

    def __init__(self, candidate: ModelProcess) -> None:
        """Begins at once, and goes on until `close` or `finish`."""
        self.candidate = candidate
        self.failed = self.dropped = 0
        self.ended: str | None = None  # why, where it ended by itself
        self._comparison = Comparison()
        self._lock = threading.Lock()  # of what is counted
        self._waiting: queue.Queue[tuple[Segment, Scores] | None] = queue.Queue(WAITING_SEGMENTS)  # None: no more
        self._thread = threading.Thread(target=self._work, name="shadow", daemon=True)
        self._thread.start()

    def see(self, segment: Segment, active: Scores) -> None:
        """Let the candidate answer, too, if it has time; does not wait for it."""
        if self.ended is not None or not self._give((segment, active)):
            with self._lock:
                self.dropped += 1

    def close(self) -> None:
        """End it at once; does not wait."""
        self.candidate.kill()
        self._give(None)

    def finish(self) -> dict[str, Any]:
        """End it when it has answered what it was given, at most `FINISH_S` later; its last report."""
        if self._give(None):
            self._thread.join(FINISH_S)
        last = self.report()
        self.close()
        return last

    def report(self) -> dict[str, Any]:
        """What came of it: `segments` that it answered, or failed at; `dropped` are those that it had no time for."""
        with self._lock:
            return {
                "model": self.candidate.name,
                "segments": self._comparison.compared + self.failed,
                "failed": self.failed,
                "dropped": self.dropped,
                "ended": self.ended,
            } | self._comparison.report()

    def _give(self, what: tuple[Segment, Scores] | None) -> bool:
        try:
            self._waiting.put_nowait(what)
        except queue.Full:
            return False
        return True

    def _work(self) -> None:
        while (given := self._waiting.get()) is not None:
            segment, active = given
            try:
                ours, theirs = (answer(self.candidate, s) for s in (active, self.candidate.classify(segment)))
            except Exception as error:  # whatever it dies of is a failure of its own
                with self._lock:
                    self.failed += 1
                    if not self.candidate.alive:
                        self.ended = str(error)
                        break
            else:
                with self._lock:
                    self._comparison.add(ours, theirs)
        self.candidate.close()


def answer(model: Classifier, scores: Scores) -> tuple[str, float]:
    """(gesture or "unknown", confidence of the best gesture) by the model's own calibration."""
    confidence = scores.confidence
    best = model.gestures[int(scores.values.argmax())]
    return (best if confidence >= scores.threshold else UNKNOWN), confidence
