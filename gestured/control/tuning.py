"""Thresholds and what they cost on recordings: gestures missed and wrong, and events that nobody meant.

A recording is played once; its answers are then counted again for each threshold.
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
from gestured.record.judge import NONE, UNNAMED, Performed, Said, owners, verdicts

THRESHOLDS = tuple(round(0.05 * k, 2) for k in range(1, 20))
CANDIDATES = (*THRESHOLDS, 0.96, 0.97, 0.98, 0.99)  # the thresholds that may be proposed
ENOUGH = 20  # the fewest performances of a gesture for which a threshold of its own is proposed
EACH = 3.0  # a wrong or false gesture costs as much as so many missed ones
GESTURES_AN_HOUR = 20  # assumed if none were performed, to compare a model's missed gestures with the false ones
DOUBT = 0.05  # probability of so few false gestures in the hours played although more than the budget come


@dataclass
class Played:
    """All that was performed in the recordings, and all that a model said of it, in order."""

    performed: list[Performed] = field(default_factory=list)  # gestures alone
    others: int = 0  # number of non-gestures performed
    said: list[Said] = field(default_factory=list)
    skipped: int = 0  # number of performances that nobody has named, or that began before the sensor was known
    seconds: float = 0.0

    @property
    def hours(self) -> float:
        """The length of all recordings."""
        return self.seconds / 3600

    @property
    def meant(self) -> float:
        """How many gestures were performed, or are assumed if none were."""
        return len(self.performed) or GESTURES_AN_HOUR * self.hours

    def add(
        self,
        performed: Sequence[Performed],
        events: Sequence[Mapping[str, Any]],
        knew: Callable[[float], bool] = lambda t: True,
    ) -> None:
        """Add the performances of one recording, and its gesture events at threshold 0, in order.

        A performance that nobody has named, or that began before the sensor was known (`knew` at a time in s), is left
        out with its events.
        """
        spans = [(float(event["onset"]), float(event["offset"])) for event in events]
        used = [one for one in performed if one.label != UNNAMED and knew(one.onset)]
        left_out = {id(one) for one in performed} - {id(one) for one in used}
        self.skipped += len(left_out)
        self.performed += [one for one in used if one.label != NONE]
        self.others += sum(one.label == NONE for one in used)
        for event, performed_then in zip(events, owners(spans, performed), strict=True):
            if id(performed_then) not in left_out:
                self.said.append(Said(str(event["gesture"]), float(event["confidence"]), performed_then))


@dataclass(frozen=True)
class Counts:
    """The numbers of gestures that are right, wrong, missed and false with some thresholds."""

    threshold: float | None  # the one of all gestures; None if each has its own
    right: int
    wrong: int
    missed: float | None  # None if not known
    false: int
    unmeant: int  # of the false ones, those that were not said of a performed non-gesture

    @property
    def cost(self) -> float:
        """The cost in missed gestures; a wrong or false one costs as much as EACH of these."""
        return (self.missed or 0.0) + EACH * (self.wrong + self.false)


def counted(played: Played, least: float | Mapping[str, float], gesture: str | None = None) -> Counts:
    """Count the answers at the threshold `least`, or at one for each gesture.

    With `gesture`, performances of that gesture are right or missed, and answers that name it may be wrong or false.
    """
    answered: dict[int, bool] = {}  # by id of a performance: whether its answer is right
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
    """The counts of `counted`; if no gesture was performed, the missed are estimated from a share (None: unknown)."""
    found = counted(played, least)
    return found if played.performed else replace(found, missed=None if share is None else share * played.meant)


def share_missed(curve: Curve, threshold: float) -> float | None:
    """The share of gestures that a model misses at one threshold for all, by its curve; None without a curve."""
    if not curve:
        return None
    thresholds, missed, _ = zip(*curve, (1.0, 1.0, 0.0), strict=True)  # at threshold 1 all are missed
    return float(np.interp(threshold, thresholds, missed))


def allowed(per_hour: float, hours: float) -> int | None:
    """The most false gestures in so many hours that show, at 95 %, a rate of at most `per_hour`; None if even 0 do not.

    False gestures are taken to be Poisson distributed: none in 3 / `per_hour` hours shows the rate.
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
    """The cheapest row of those with at most `most` unmeant; of equally cheap ones, the one nearest to `now`.

    If the number of missed gestures is not known, it is the first row with so few, or None without `most`.
    """
    few = [row for row in rows if most is None or row.unmeant <= most]
    if any(row.missed is None for row in few):
        return few[0] if most is not None else None
    return min(few, key=lambda row: (row.cost, abs((row.threshold or now) - now)), default=None)


def for_each(played: Played, now: float, *, no_more: bool = False) -> dict[str, Counts]:
    """By gesture: what is proposed for it alone, if it was performed at least ENOUGH times.

    With `no_more`, no gesture gets more unmeant answers than at the threshold `now`.
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
    """The figures of all thresholds, and the proposal."""

    model: Model
    played: Played
    rows: Sequence[Counts]  # one for each of THRESHOLDS
    points: Mapping[str, Counts]  # by strictness, if the model has operating points
    now: Counts  # at the model's usual strictness, or its own threshold
    budget: float | None  # the most false gestures an hour
    most: int | None  # the most false gestures in all that show that the budget is kept
    best: Counts | None  # what is proposed; its threshold is that of the gestures that are not in `each`
    each: Mapping[str, Counts]  # by gesture: what is proposed for it alone

    @property
    def strictness(self) -> str | None:
        """The strictness that is proposed in place of thresholds, if any."""
        return next((name for name, row in self.points.items() if row is self.best), None)

    @property
    def missed_by(self) -> str | None:
        """What the missed gestures are known from: "recordings", "model" or None."""
        return "recordings" if self.played.performed else "model" if self.points else None


def tune(model: Model, played: Played, budget: float | None) -> Tuned:
    """Count what thresholds cost, and propose. Raises GesturedError if the budget cannot be shown or kept."""
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
    # Without performed gestures, a row that misses fewer than usual must be shown to have no more false ones.
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
    rows = (usual, *points.values(), best)  # of those that cost the same, `proposed` takes the first
    best = proposed([row for row in rows if row is not None and may_be(row)], model.threshold, most)
    if best is None and most is not None:
        left = {name: counted(played, CANDIDATES[-1], name).unmeant for name in model.gestures}
        raise GesturedError(
            f"--budget {budget:g}: at {CANDIDATES[-1]} there are still {sum(left.values())} false ones in "
            f"{played.hours:.3g} hours, expected at most {most}; most of them are {max(left, key=left.__getitem__)}"
        )
    now = usual or estimated(played, model.threshold, None)
    return Tuned(model, played, alike[: len(THRESHOLDS)], points, now, budget, most, best, single)
