"""Models judged in hours that pass through the daemon's own path: false gestures, and what became of meant ones."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.decision import Decision
from gestured.core.events import Gesture, Onset, Provisional, Unknown
from gestured.core.facts import Decided
from gestured.core.front_end import FrontEnd
from gestured.core.listening import Arming
from gestured.core.points import USUAL, Strictness
from gestured.core.scene import DOUBLE_TAP, ONE_TAP, Scene
from gestured.core.segmenter import SPENT
from gestured.core.sensor import ABSENT_S, Sensor, Told
from gestured.lab.everyday.stretches import HEARD, HOUR_S, WOKEN, Stretch
from gestured.lab.intervals import rate
from gestured.model.model import Model
from gestured.record.judge import NONE, UNNAMED, Performed, Said, verdicts, whose
from gestured.simulator import GESTURES

TAPS = (ONE_TAP, DOUBLE_TAP)
LONGEST_STEP_S = 1.0  # s, the most of a step between frames that counts as deaf; in a longer one the sensor was silent
NOT_READY, RESTARTING, HELD = "not ready", "restarting", "spent"  # why a sensor is deaf


@dataclass
class Heard:
    """Each model's answers in one stretch, and how long the sensor was deaf."""

    place: str
    person: str
    contacts: int
    meant: list[Performed]
    said: dict[str, list[Said]]  # by model: answers to contacts that may be published at all, at any confidence
    seconds: float = 0.0  # without silences, as far as they are longer than ABSENT_S
    deaf_s: dict[str, float] = field(default_factory=dict)
    provisional: int = 0  # provisional events of the first model while nothing was meant

    @property
    def hours(self) -> float:
        """The length of the stretch in hours."""
        return self.seconds / HOUR_S


def hear(
    life: Stretch,
    models: Sequence[Model],
    strictness: Strictness,
    arming: Arming | None = None,
    *,
    published: bool = False,
) -> Heard:
    """Play a stretch to the first model at its operating point, and give its segments to the other models, too.

    With `arming` a gesture arms the sensor. With `arming` or `published`, only answers that are published count.
    """
    first, published = models[0], published or arming is not None
    scene = Scene(
        first.gestures, (9, 9), {"lab": life.setup}, strictness=strictness, tap_gap_s=life.tap_gap_s, arming=arming
    )
    sensor = Sensor("lab", scene, first)
    sensor.foresee(asked=True)
    meant = [act for act in life.meant if act.label in first.gestures]
    # Gestures of the user's own are enrolled: none of the model's answers is right or wrong for them.
    own = [replace(act, label=UNNAMED) for act in life.meant if act.label not in first.gestures]
    life = replace(life, meant=meant, others=[*life.others, *own])
    heard = Heard(life.place, life.person, 0, meant, {model.name: [] for model in models})
    began: float | None = None
    last, absent_s, known, onsets = 0.0, 0.0, False, 0
    for frame in life.frames:
        began, last = (frame.t, frame.t) if began is None else (began, last)
        told = sensor.push(frame)
        known = known or sensor.front_end.ready
        why = _deaf(sensor.front_end, known=known)
        if why:
            heard.deaf_s[why] = heard.deaf_s.get(why, 0.0) + min(frame.t - last, LONGEST_STEP_S)
        absent_s += max(frame.t - last - ABSENT_S, 0.0)
        last = frame.t
        onsets += sum(isinstance(one, Onset) for one in told)
        _take(heard, told, life, models, published=published)
    _take(heard, sensor.flush(last + 5.0), life, models, published=published)
    heard.seconds = last - (last if began is None else began) - absent_s
    told_of = len(meant) + sum(act.label == UNNAMED for act in life.others)
    heard.contacts = max(onsets - told_of, 0) if life.contacts is None else life.contacts
    return heard


def _deaf(front_end: FrontEnd, *, known: bool) -> str:
    """Why no gesture can begin now; empty if one can. `known`: the idle sensor has been known before."""
    if front_end.segmenter.phase is SPENT:
        return HELD
    if not front_end.ready:
        return RESTARTING if known else NOT_READY
    return RESTARTING if front_end.look is not None and front_end.look.shifted else ""


def _take(heard: Heard, told: Iterable[Told], life: Stretch, models: Sequence[Model], *, published: bool) -> None:
    answer: Gesture | Unknown | None = None
    for one in told:
        if isinstance(one, Provisional):
            heard.provisional += _whose(one.gesture, one.onset, one.decided, life) is None
        elif isinstance(one, Gesture | Unknown):
            answer = one
        elif isinstance(one, Decided) and not (isinstance(answer, Unknown) and (published or answer.reason == "hole")):
            decision = Decision(Scene(models[0].gestures, (9, 9), {"lab": life.setup}), "lab")
            zone = answer.where.zone if answer and answer.where else None
            for model in models:
                scores = one.scores if model is models[0] else model.classify(one.segment)
                _, name, confidence = decision.best(model.gestures, scores, zone)
                act = _whose(name, one.segment.onset, one.segment.offset, life)
                if act is None or act.label != UNNAMED:
                    heard.said[model.name].append(Said(name, confidence, act))


def _whose(gesture: str, onset: float, offset: float, life: Stretch) -> Performed | None:
    """What an answer belongs to: a performance, or a tap that nobody meant; None if the answer is a false gesture."""
    act = whose(onset, offset, [*life.meant, *life.others])
    if act is None and gesture in TAPS:
        return whose(onset, offset, life.taps)
    return None if act is not None and act.label == NONE else act


FEW = 5  # people; an interval over fewer says nothing
# Thresholds of a curve, denser at the end, at which few false gestures are left.
LEVELS = np.round(np.concatenate([np.arange(0.05, 0.95, 0.01), np.arange(0.95, 0.9995, 0.001)]), 4).tolist()

Least = float | Mapping[str, float]  # confidence from which a gesture is published: one for all, or by gesture


@dataclass
class Hours:
    """Stretches judged at thresholds of one model."""

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
                self.said["apart"] += 1  # a tap that nobody meant is no false gesture
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
        """The 95 % interval of false gestures an hour: over people, or by chance alone for fewer than FEW people."""
        hours, false = np.array(list(self.each.values()), float).T
        return rate([false.sum()], [hours.sum()]) if len(hours) < FEW else rate(false, hours)

    def figures(self) -> dict[str, Any]:
        """The figures as JSON values."""
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
    """Judge stretches at the thresholds `least` of a model."""
    hours = Hours()
    for one in heard:
        hours.add(one, model, least)
    return hours


def shares(became: Mapping[str, int]) -> dict[str, Any]:
    """How many gestures were meant, and the shares of them right, wrong and missed; None if none was meant."""
    total = sum(became.get(how, 0) for how in ("right", "wrong", "missed"))
    parts = {how: round(became.get(how, 0) / total, 4) if total else None for how in ("right", "wrong", "missed")}
    return {"meant": total, **parts}


def thresholds(least: Least) -> NDArray[np.float64]:
    """(G,) the confidence from which each of the simulator's gestures is published."""
    return np.array([least[name] if isinstance(least, Mapping) else least for name in GESTURES])


def points_of(model: Model) -> dict[str, Least]:
    """The operating points of a model: thresholds by strictness; its one threshold if it has none."""
    if model.points is None:
        return {USUAL: model.threshold}
    return {name: dict(point.thresholds) for name, point in model.points.items()}


def cost(heard: Sequence[Heard], model: str, least: Least) -> dict[str, float | None]:
    """What thresholds cost: false gestures an hour, and the shares of those meant that were wrong and missed."""
    found = judged(heard, model, least)
    parts = shares(found.said)
    false = round(found.said["false"] / found.hours, 3)
    return {"false_per_hour": false, "wrong": parts["wrong"], "missed": parts["missed"]}


def curve(heard: Sequence[Heard], model: str) -> list[dict[str, float | None]]:
    """What one threshold for all gestures costs, from the lowest to the highest."""
    return [{"threshold": level} | cost(heard, model, level) for level in LEVELS]
