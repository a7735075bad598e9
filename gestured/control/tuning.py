"""Thresholds, by what they cost on recordings: gestures lost and wrong, and events that nobody meant.

A recording is played once; at every threshold it is only counted again.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gestured.core.errors import GesturedError
from gestured.core.points import USUAL, Curve
from gestured.model.model import Model
from gestured.record.judge import NONE, Performed, Said, owners, verdicts

THRESHOLDS = tuple(round(0.05 * k, 2) for k in range(1, 20))
CANDIDATES = (*THRESHOLDS, 0.96, 0.97, 0.98, 0.99)  # that may be proposed
ENOUGH = 20  # performances of a gesture before anything is proposed for it alone
EACH = 3.0  # gestures that are missed, to which a wrong or a false one is equal
GESTURES_AN_HOUR = 20  # assumed where nobody performed any, to hold what a model misses against what is false
DOUBT = 0.05  # probability that hours show so few false ones although more come


@dataclass
class Played:
    """All that was performed, and all that was said, in their order."""

    performed: list[Performed] = field(default_factory=list)  # gestures alone
    others: int = 0  # non-gestures
    said: list[Said] = field(default_factory=list)
    skipped: int = 0  # performed before the sensor was known
    seconds: float = 0.0

    @property
    def hours(self) -> float:
        """How long all recordings take."""
        return self.seconds / 3600

    @property
    def meant(self) -> float:
        """How many gestures were performed; where none were, how many are assumed."""
        return len(self.performed) or GESTURES_AN_HOUR * self.hours

    def add(
        self,
        performed: Sequence[Performed],
        events: Sequence[Mapping[str, Any]],
        knew: Callable[[float], bool] = lambda t: True,
    ) -> None:
        """What one recording holds, and its events in their order, published from no confidence at all.

        What began before the sensor was known, as `knew` says of a time (s), is left out with all that was said of it.
        """
        spans = [(float(event["onset"]), float(event["offset"])) for event in events]
        used = [one for one in performed if knew(one.onset)]
        left_out = {id(one) for one in performed} - {id(one) for one in used}
        self.skipped += len(left_out)
        self.performed += [one for one in used if one.label != NONE]
        self.others += sum(one.label == NONE for one in used)
        for event, performed_then in zip(events, owners(spans, performed), strict=True):
            if id(performed_then) not in left_out:
                self.said.append(Said(str(event["gesture"]), float(event["confidence"]), performed_then))


@dataclass(frozen=True)
class Counts:
    """What thresholds cost."""

    threshold: float | None  # of all gestures alike; None where each has its own
    right: int
    wrong: int
    missed: float | None  # None where nobody knows
    false: int
    unmeant: int  # of the false ones, those that were not said of a non-gesture which was performed

    @property
    def cost(self) -> float:
        """In gestures that are missed; a wrong or a false one costs as much as EACH of them."""
        return (self.missed or 0.0) + EACH * (self.wrong + self.false)


def counted(played: Played, least: float | Mapping[str, float], gesture: str | None = None) -> Counts:
    """Count the answers that are right, wrong, missed or false at a threshold, or at one for each gesture.

    With `gesture`, performances of that gesture can be right or missed, and answers that name it wrong or false.
    """
    answered: dict[int, bool] = {}  # performed -> whether rightly
    wrong = false = provoked = 0
    for said, found in verdicts(played.said, least):
        if found != "false":
            answered[id(said.performed)] = found == "right"
        if gesture in (None, said.gesture):
            wrong, false = wrong + (found == "wrong"), false + (found == "false")
            provoked += said.performed is not None and said.performed.label == NONE
    own = [one for one in played.performed if gesture in (None, one.label)]
    right = sum(answered.get(id(one), False) for one in own)
    lost = len(own) - right if gesture else sum(id(one) not in answered for one in own)
    return Counts(None if isinstance(least, Mapping) else least, right, wrong, lost, false, false - provoked)


def estimated(played: Played, least: float | Mapping[str, float], share: float | None) -> Counts:
    """What `counted` counts; where nobody performed a gesture, the share of them that is missed, None if unknown."""
    found = counted(played, least)
    return found if played.performed else replace(found, missed=None if share is None else share * played.meant)


def share_missed(curve: Curve, threshold: float) -> float | None:
    """What a model misses at a threshold of all gestures alike, by its curve; None for one that has none."""
    if not curve:
        return None
    thresholds, missed, _ = zip(*curve, (1.0, 1.0, 0.0), strict=True)  # nobody is surer than sure
    return float(np.interp(threshold, thresholds, missed))


def allowed(per_hour: float, hours: float) -> int | None:
    """The most false gestures in so many hours that show, at 95 %, that no more than `per_hour` come in an hour.

    Events that come by chance (Poisson): none in three times as long as one may take. None where no count shows it.
    """
    mean, chance, count = per_hour * hours, 0.0, -1
    if mean == 0:
        return None
    while True:
        chance += math.exp((count + 1) * math.log(mean) - mean - math.lgamma(count + 2))
        if chance > DOUBT:
            return count if count >= 0 else None
        count += 1


def proposed(rows: Sequence[Counts], now: float, most: int | None = None) -> Counts | None:
    """The row that costs least, of those with at most `most` unmeant; of equal ones that nearest to what is set `now`.

    Where nobody knows what is missed it is the first with so few (their thresholds rise). None where there is none.
    """
    few = [row for row in rows if most is None or row.unmeant <= most]
    if any(row.missed is None for row in few):
        return few[0] if most is not None else None
    return min(few, key=lambda row: (row.cost, abs((row.threshold or now) - now)), default=None)


def for_each(played: Played, now: float, *, no_more: bool = False) -> dict[str, Counts]:
    """What is proposed for single gestures: those that were performed often enough.

    With `no_more`, none of them says more that nobody meant than at the threshold that is set `now`.
    """
    performed = Counter(one.label for one in played.performed)
    found = {}
    for name, count in sorted(performed.items()):
        most = counted(played, now, name).unmeant if no_more else None
        best = proposed([counted(played, t, name) for t in CANDIDATES], now, most) if count >= ENOUGH else None
        if best is not None:
            found[name] = best
    return found


@dataclass(frozen=True)
class Tuned:
    """All that is told."""

    model: Model
    played: Played
    rows: Sequence[Counts]  # a threshold each
    points: Mapping[str, Counts]  # by strictness, where the model has operating points
    now: Counts  # at the model's usual strictness, or its own threshold
    budget: float | None  # false ones an hour
    most: int | None  # false ones in all, which show that
    best: Counts | None  # what is proposed; its threshold is of the gestures that are not in `each`
    each: Mapping[str, Counts]  # what is proposed for single gestures

    @property
    def strictness(self) -> str | None:
        """The strictness that is proposed in place of thresholds."""
        return next((name for name, row in self.points.items() if row is self.best), None)

    @property
    def missed_by(self) -> str | None:
        """Who says what is missed: the recordings, the model, or nobody."""
        return "recordings" if self.played.performed else "model" if self.points else None


def tune(model: Model, played: Played, budget: float | None) -> Tuned:
    """Count what thresholds cost, and propose. Raises GesturedError for a budget that cannot be shown, or kept."""
    most = None if budget is None else allowed(budget, played.hours)
    if budget is not None and most is None:
        raise GesturedError(
            f"--budget {budget:g}: {played.hours:.3g} hours cannot show it, even if nothing false was said in them, "
            f"expected at least {math.ceil(30 / budget) / 10:g} hours"
        )
    alike = [estimated(played, t, share_missed(model.metadata.curve, t)) for t in CANDIDATES]
    stored = (model.points or {}).items()
    points = {name: estimated(played, point.thresholds, point.missed) for name, point in stored}
    usual = points.get(USUAL)
    # Where nobody performed anything, what says more than usual must be shown to be false no more often.
    unasked = usual is not None and budget is None and not played.performed
    few = allowed(model.points[USUAL].false_per_hour, played.hours) if model.points and unasked else None

    def may_be(row: Counts) -> bool:
        more = usual is not None and (row.missed or 0) < (usual.missed or 0)
        return not (unasked and more) or (few is not None and row.unmeant <= few)

    best, single = proposed([row for row in alike if may_be(row)], model.threshold, most), dict[str, Counts]()
    if best is not None and best.threshold is not None and played.performed:
        single = for_each(played, best.threshold, no_more=most is not None)
        together = counted(played, {name: single.get(name, best).threshold or 0.0 for name in model.gestures})
        if together.cost <= best.cost and (most is None or together.unmeant <= most):
            best = replace(together, threshold=best.threshold)
        else:
            single = {}
    rows = (usual, *points.values(), best)  # of those that cost the same the first is taken
    best = proposed([row for row in rows if row is not None and may_be(row)], model.threshold, most)
    if best is None and most is not None:
        left = {name: counted(played, CANDIDATES[-1], name).unmeant for name in model.gestures}
        raise GesturedError(
            f"--budget {budget:g}: at {CANDIDATES[-1]} there are still {sum(left.values())} false ones in "
            f"{played.hours:.3g} hours, expected at most {most}; most of them are {max(left, key=left.__getitem__)}"
        )
    now = usual or estimated(played, model.threshold, None)
    return Tuned(model, played, alike[: len(THRESHOLDS)], points, now, budget, most, best, single)
