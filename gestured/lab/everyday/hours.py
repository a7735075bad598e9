"""How what was said in some hours went: false gestures an hour, and what became of those that were meant."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from gestured.core.points import USUAL
from gestured.lab.everyday.heard import Heard
from gestured.lab.everyday.stretches import HEARD, WOKEN
from gestured.lab.intervals import rate
from gestured.model.model import Model
from gestured.record.judge import NONE, verdicts

FEW = 5  # people; of fewer an interval over them says nothing
# Thresholds of a curve: closer to one another where few false gestures are left.
LEVELS = np.round(np.concatenate([np.arange(0.05, 0.95, 0.01), np.arange(0.95, 0.9995, 0.001)]), 4).tolist()

Least = float | Mapping[str, float]  # confidence from which a gesture is published, of all alike or by gesture


@dataclass
class Hours:
    """Some stretches of hours, judged at some thresholds of one model."""

    hours: float = 0.0
    contacts: int = 0
    provisional: int = 0  # false ones
    deaf_s: dict[str, float] = field(default_factory=dict)  # by reason
    said: Counter[str] = field(default_factory=Counter)  # right, wrong, missed, false, apart
    false: Counter[str] = field(default_factory=Counter)  # by gesture
    meant: Counter[tuple[str, str]] = field(default_factory=Counter)  # (gesture that was meant, right, wrong or missed)
    lay: Counter[tuple[str, str]] = field(default_factory=Counter)  # the same by what lay on the sensor
    each: dict[str, tuple[float, int]] = field(default_factory=dict)  # by person: hours, and false gestures

    def add(self, one: Heard, model: str, least: Least) -> None:
        """Judge one more stretch."""
        self.hours, self.contacts = self.hours + one.hours, self.contacts + one.contacts
        self.provisional += one.provisional
        for why, seconds in one.deaf_s.items():
            self.deaf_s[why] = self.deaf_s.get(why, 0.0) + seconds
        became = {id(act): "missed" for act in one.meant}
        false = 0
        for said, found in verdicts(one.said[model], least):
            if found != "false":
                became[id(said.performed)] = found
            elif said.performed is not None and said.performed.label == NONE:
                self.said["apart"] += 1  # only a tap in truth is no gesture here
            else:
                self.false[said.gesture] += 1
                false += 1
        self.said["false"] += false
        for act in one.meant:
            how = became[id(act)]
            self.said[how] += 1
            self.meant[act.label, how] += 1
            self.lay[act.kind, how] += 1
        for wakes, act in pairwise(one.meant):
            if act.kind == WOKEN and became[id(wakes)] == "right":
                self.lay[HEARD, became[id(act)]] += 1
        hours, before = self.each.get(one.person, (0.0, 0))
        self.each[one.person] = hours + one.hours, before + false

    def interval(self) -> tuple[float, float]:
        """95 % of false gestures an hour, over people; of fewer than FEW as if they came by chance."""
        hours, false = np.array(list(self.each.values()), float).T
        return rate([false.sum()], [hours.sum()]) if len(hours) < FEW else rate(false, hours)

    def figures(self) -> dict[str, Any]:
        """All of it as JSON values."""
        low, high = self.interval()
        return {
            "hours": round(self.hours, 4),
            "people": len(self.each),
            "contacts": self.contacts,
            "contacts_per_hour": round(self.contacts / self.hours, 1),
            "false_per_hour": round(self.said["false"] / self.hours, 3),
            "low": round(low, 3),
            "high": round(high, 3),
            "false_per_100_contacts": round(100 * self.said["false"] / max(self.contacts, 1), 3),
            "apart_per_hour": round(self.said["apart"] / self.hours, 3),
            "provisional_false_per_hour": round(self.provisional / self.hours, 3),
            **shares(self.said),
            "deaf_minutes_per_hour": {why: round(s / 60 / self.hours, 3) for why, s in sorted(self.deaf_s.items())},
        }


def judged(heard: Iterable[Heard], model: str, least: Least) -> Hours:
    """Stretches at the thresholds `least` of a model."""
    hours = Hours()
    for one in heard:
        hours.add(one, model, least)
    return hours


def shares(became: Mapping[str, int]) -> dict[str, Any]:
    """How many gestures were meant, and the shares of them that were right, wrong and missed; None of none."""
    total = sum(became.get(how, 0) for how in ("right", "wrong", "missed"))
    parts = {how: round(became.get(how, 0) / total, 4) if total else None for how in ("right", "wrong", "missed")}
    return {"meant": total, **parts}


def points_of(model: Model) -> dict[str, Least]:
    """The operating points of a model: thresholds by strictness; its one threshold where it has none."""
    if model.points is None:
        return {USUAL: model.threshold}
    return {name: dict(point.thresholds) for name, point in model.points.points.items()}


def cost(heard: Sequence[Heard], model: str, least: Least) -> dict[str, float | None]:
    """What thresholds cost: false gestures an hour, and the shares of those meant that were wrong and missed."""
    found = judged(heard, model, least)
    parts = shares(found.said)
    false = round(found.said["false"] / found.hours, 3)
    return {"false_per_hour": false, "wrong": parts["wrong"], "missed": parts["missed"]}


def curve(heard: Sequence[Heard], model: str) -> list[dict[str, float | None]]:
    """What one threshold of all gestures costs, from the lowest to the highest."""
    return [{"threshold": level} | cost(heard, model, level) for level in LEVELS]
