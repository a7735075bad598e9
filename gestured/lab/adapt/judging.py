"""What answers are worth: shares of the gestures that were performed, and the same at an equal share of wrong ones.

Training moves the confidence more than the order of the answers, so two models are compared where both are wrong
equally often.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gestured.lab import decide
from gestured.lab.adapt.learning import classes_of
from gestured.lab.intervals import interval
from gestured.lab.samples import Samples
from gestured.simulator import NONE


@dataclass(frozen=True)
class Answers:
    """Answers to samples: one row each; gestures that were never cut out have rows, too, without an answer."""

    known: NDArray[np.bool_]  # (N,) a gesture of the model was performed
    right: NDArray[np.bool_]  # (N,) the best score is its
    confidence: NDArray[np.float64]  # (N,) -1 where nothing was cut out
    unit: NDArray[np.int64]  # (N,) who performed it: what intervals are drawn over

    @classmethod
    def of(cls, samples: Samples, said: decide.Answers, missed: NDArray[np.int64]) -> "Answers":
        """What is `said` of the samples; `missed` (M,) are the units of what was never cut out."""
        lost = np.zeros(len(missed))
        known = samples.labels != NONE
        return cls(
            np.concatenate([known, lost == 0]),
            np.concatenate([known & (said[0].argmax(axis=1) == classes_of(samples)), lost > 0]),
            np.concatenate([decide.confidence(said), lost - 1]),
            np.concatenate([samples.people, missed]),
        )

    def where(self, chosen: NDArray[np.bool_], other: "Answers") -> "Answers":
        """The same rows, the chosen ones answered by the other."""
        return Answers(
            self.known,
            np.where(chosen, other.right, self.right),
            np.where(chosen, other.confidence, self.confidence),
            self.unit,
        )

    def shares(self, least: float) -> "Shares":
        """What they are worth, published from a confidence of `least` on."""
        published = self.confidence >= least
        known, others = self.known, ~self.known
        right, wrong = published & self.right, published & known & ~self.right
        low_high = [
            interval(rows[of], self.unit[of])
            for rows, of in ((right, known), (wrong, known), (known & ~published, known), (published, others))
        ]
        return Shares(int(known.sum()), int(others.sum()), *low_high)

    def least_for(self, wrong: float, accepted: float = 1.0) -> float:
        """The lowest confidence from which at most these shares of gestures are wrong and of others accepted."""
        order = np.argsort(-self.confidence, kind="stable")
        confidence, known = self.confidence[order], self.known[order]
        bad = np.cumsum(known & ~self.right[order]) / max(int(known.sum()), 1)
        taken = np.cumsum(~known) / max(int((~known).sum()), 1)
        over = np.flatnonzero((bad > wrong + 1e-9) | (taken > accepted + 1e-9))
        if not len(over):
            return LOWEST
        return float(np.clip(np.nextafter(confidence[over[0]], 2.0), LOWEST, HIGHEST))


LOWEST, HIGHEST = 0.05, 0.95  # of a threshold

Interval = tuple[float, float, float]  # share, and the ends of its 95 % interval


@dataclass(frozen=True)
class Shares:
    """Shares of the gestures that were performed, and of the non-gestures; NaN where there are none."""

    gestures: int
    others: int
    right: Interval
    wrong: Interval
    unknown: Interval  # or never cut out
    accepted: Interval  # of the non-gestures

    def as_dict(self) -> dict[str, object]:
        """As JSON values: null for what is not known."""
        found: dict[str, object] = {"gestures": self.gestures, "non_gestures": self.others}
        for name in ("right", "wrong", "unknown", "accepted"):
            value = getattr(self, name)
            rounded = [None if np.isnan(one) else round(float(one), 4) for one in value]
            found[name] = {"share": rounded[0], "low": rounded[1], "high": rounded[2]}
        return found
