"""When a provisional event may be given: thresholds by elapsed time, learned from people held out.

Learn-then-Test (Angelopoulos and others, arXiv 2110.01052; for early decisions Ringel and others, ICML 2024, arXiv
2402.00857, written anew from the papers). In each stretch of time since the onset, thresholds are tried from the safest
one on, as long as a binomial test over people says that enough of their events are confirmed. A contact that gets its
event in one stretch is left out of the later ones.

`Foretold` holds the answers of networks to contacts before they are over.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from torch import nn

from gestured.core.scene import DOUBLE_TAP, ONE_TAP
from gestured.lab.decide import Answers, confidence
from gestured.lab.nets import Judged
from gestured.lab.prefixes import floors, prefixes
from gestured.lab.samples import WINDOW, Samples, join, packed
from gestured.lab.verifier import Evidence
from gestured.model.features import ACTIVE
from gestured.simulator import GESTURES, NONE

CONFIRMED = 0.97  # share of the events that the answer must confirm, in every stretch
DOUBT = 0.1  # probability that a threshold passes although too few of its events are confirmed
IN_A_ROW = 1  # consecutive frames that must be sure enough: a second one would cost 67 ms; thresholds make up for it
STRETCHES = (0.0, 0.233, 0.367, 0.5, 0.7, 1.0)  # their beginnings in s, half-way between frames at 15 Hz
STARTS = (120, 240, 480)  # people with an event; fewer than 112 could never pass with a third of the doubt
# Thresholds from the safest on, each with a sixth more doubt (1 - confidence) than the one before.
LADDER = tuple(round(1 - float(doubt), 4) for doubt in np.geomspace(0.001, 0.5, 41))


Questions = tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]  # see `safe_from`


@dataclass(frozen=True, slots=True)
class Asked:
    """N questions to a model, one at every frame of G contacts, and its answers in the end."""

    contact: NDArray[np.int64]  # (N,) 0 .. G-1, in order
    elapsed_s: NDArray[np.float64]  # (N,) since the contact's onset, increasing within it
    best: NDArray[np.int64]  # (N,) gesture
    confidence: NDArray[np.float64]  # (N,)
    answer: NDArray[np.int64]  # (G,) gesture that was published, or -1
    person: NDArray[np.int64]  # (G,)

    @property
    def stretch(self) -> NDArray[np.int64]:
        """(N,) index into `STRETCHES` of each question."""
        return np.searchsorted(STRETCHES, self.elapsed_s + 1e-9, side="right") - 1


def given(sure_enough: NDArray[np.bool_], contact: NDArray[np.int64]) -> NDArray[np.int64]:
    """The questions at which events are given: the first one of each contact that is sure enough, in order."""
    reached = np.flatnonzero(sure_enough)
    return reached[np.unique(contact[reached], return_index=True)[1]]


def _revoked(people: NDArray[np.int64], revoked: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(P,) the share of each person's events that were revoked."""
    _, who = np.unique(people, return_inverse=True)
    return np.bincount(who, revoked) / np.bincount(who)


def chance_of(people: NDArray[np.int64], revoked: NDArray[np.bool_]) -> float:
    """The probability of so few revoked events if fewer than `CONFIRMED` are confirmed: a binomial test over people."""
    if not len(people):
        return 1.0
    each = _revoked(people, revoked)
    return float(stats.binom.cdf(math.ceil(each.sum() - 1e-9), len(each), 1 - CONFIRMED))


def safe_from(
    sure: NDArray[np.float64], contact: NDArray[np.int64], wrong: NDArray[np.bool_], person: NDArray[np.int64]
) -> float | None:
    """The lowest threshold that passes for the questions of one stretch, None for none.

    `wrong` (N,) says whether an event given at a question would be revoked; `person` (N,) whose question it is. The
    test starts once for each of `STARTS`, at the first threshold that gives so many people an event, with an equal part
    of the doubt. At the safest threshold so few people have one that a single revoked event would end the test.
    """
    chances: list[tuple[float, int, float]] = []
    for threshold in LADDER:
        events = given(sure >= threshold, contact)
        chances.append((threshold, len(np.unique(person[events])), chance_of(person[events], wrong[events])))
    found: float | None = None
    for start in STARTS:
        for threshold, people, chance in chances:
            if people < start:
                continue
            if chance > DOUBT / len(STARTS):
                break
            found = threshold if found is None else min(found, threshold)
    return found


def deceives(questions: Questions, level: float) -> bool:
    """Whether events at this threshold are revoked significantly more often than allowed."""
    sure, contact, wrong, person = questions
    events = given(sure >= level, contact)
    if not len(events):
        return False
    each = _revoked(person[events], wrong[events])
    return bool(stats.binom.sf(math.floor(each.sum() + 1e-9) - 1, len(each), 1 - CONFIRMED) <= DOUBT)


def calibrated(asked: Asked, gestures: Sequence[str], tap: float | None) -> dict[str, Any]:
    """The metadata `provisional`: for each stretch, and for each gesture with enough data, the threshold."""
    stretch, wrong = asked.stretch, asked.answer[asked.contact] != asked.best
    person = asked.person[asked.contact]
    over = np.zeros(len(asked.answer), bool)  # contacts whose event is given
    general: list[float | None] = []
    rows: dict[str, list[float | None]] = {name: [] for name in gestures}

    for k in range(len(STRETCHES)):
        now = (stretch == k) & ~over[asked.contact]

        def of(chosen: NDArray[np.bool_]) -> Questions:
            return asked.confidence[chosen], asked.contact[chosen], wrong[chosen], person[chosen]

        everybody = safe_from(*of(now))
        general.append(everybody)
        for g, name in enumerate(gestures):
            mine = of(now & (asked.best == g))
            own = safe_from(*mine)
            if everybody is not None and deceives(mine, everybody):
                rows[name].append(own if own is not None and own > everybody else None)
            else:
                rows[name].append(min((t for t in (own, everybody) if t is not None), default=None))
        level = np.array([row[-1] if row[-1] is not None else np.inf for row in rows.values()])[asked.best]
        over[asked.contact[now & (asked.confidence >= level)]] = True
    return {
        "in_a_row": IN_A_ROW,
        "elapsed_s": list(STRETCHES),
        "thresholds": general,
        "gestures": {name: row for name, row in rows.items() if row != general},
        "tap": tap,
    }


def published(answers: Answers, least: float | NDArray[np.float64]) -> NDArray[np.int64]:
    """(N,) the gesture that is published from a confidence of `least` on, one for all or (G,) of each; -1 for none."""
    best = answers[0].argmax(axis=1)
    needed = np.broadcast_to(least, answers[0].shape[1])[best]
    return np.where(confidence(answers) >= needed, best, -1)


def at_release(samples: Samples) -> Samples:
    """The samples up to the frame at which the finger first leaves: of two contacts the first one alone."""
    least, windows = floors(samples), []
    for i in range(len(samples)):
        window = samples.window(i)
        first, last = int(samples.first[i]), int(samples.last[i])
        quiet = np.flatnonzero(window[first : last + 1].max(axis=(1, 2)) < ACTIVE * window.max())
        if len(quiet):
            part = window[: first + int(quiet[0]) + 1]
            window = part / max(float(part.max()), float(least[i]))
        windows.append(window.astype(np.float16))
    frames, offsets = packed(windows)
    return replace(samples, frames=frames, offsets=offsets)


def tap_threshold(answers: Answers, answer: NDArray[np.int64], person: NDArray[np.int64], tap: int) -> float | None:
    """The threshold for a tap at the release, by a model's `answers` to G contacts then and its `answer` in the end.

    Contacts that a second tap follows must be left out: nobody can foresee it.
    """
    scores, unknown = answers
    exactly = scores.max(axis=1).astype(np.float64) * (1 - unknown)
    sure = np.where(scores.argmax(axis=1) == tap, exactly, 0.0)
    return safe_from(sure, np.arange(len(person)), answer != tap, person)


Evidences = Mapping[str, Evidence]  # by network, each with the trajectory net beside it
OTHERS = 0.2  # share of non-gestures among what is performed, as in the sessions of `gestured.lab.online`


@dataclass(frozen=True, slots=True)
class Foretold:
    """Samples of people who were held out, with the evidence of each network on them."""

    samples: Samples
    whole: Evidences
    released: Evidences  # up to the frame at which the finger first leaves
    prefixes: Evidences  # at every touched frame
    contact: NDArray[np.int64]  # (N,) the sample that each prefix is of
    since: NDArray[np.int64]  # (N,) frames since its onset
    second: NDArray[np.bool_]  # (N,) whether the finger had left and come back

    @classmethod
    def sessions(cls, parts: Sequence[tuple[nn.ModuleDict, Samples]]) -> "Foretold":
        """Ask each part's networks about its samples, with as many non-gestures, drawn at random, as sessions hold."""
        parts = [(nets, samples.take(as_in_sessions(samples))) for nets, samples in parts]
        cut = [prefixes(samples) for _, samples in parts]
        before = np.cumsum([0, *(len(samples) for _, samples in parts)])[:-1]  # samples of the parts before
        contact = np.concatenate([of + start for (_, of, _), start in zip(cut, before, strict=True)])
        since = np.concatenate([frames for _, _, frames in cut])
        # Whether an earlier frame of the contact was not touched.
        second = since > np.arange(len(contact)) - np.searchsorted(contact, contact)
        whole = _joined([_evidence(nets, samples) for nets, samples in parts])
        released = _joined([_evidence(nets, at_release(samples)) for nets, samples in parts])
        early = _joined([_evidence(nets, some) for (nets, _), (some, _, _) in zip(parts, cut, strict=True)])
        return cls(join([samples for _, samples in parts]), whole, released, early, contact, since, second)

    def rule(self, name: str, module: Judged, least: float | NDArray[np.float64]) -> dict[str, Any]:
        """The metadata `provisional` of a network that publishes from `least` on, for all or (G,) of each gesture."""
        scores, unknown = _said(self.prefixes, name, module)
        final = published(_said(self.whole, name, module), least)
        best, confidence = scores.argmax(axis=1), scores.max(axis=1).astype(np.float64) * (1 - unknown)
        # As at run time: no single tap while the finger is down, and a double tap in a second contact and nowhere else.
        tap, two_taps = GESTURES.index(ONE_TAP), best == GESTURES.index(DOUBLE_TAP)
        confidence[(two_taps != self.second) | (best == tap)] = 0.0
        asked = Asked(self.contact, self.since / WINDOW.rate_hz, best, confidence, final, self.samples.people)
        # Contacts to which the finger comes back are left out, since nobody can foresee it at the release.
        single = at_release(self.samples).lengths() == self.samples.lengths()
        scores, unknown = _said(self.released, name, module)
        people = self.samples.people[single]
        released = tap_threshold((scores[single], unknown[single]), final[single], people, tap)
        return calibrated(asked, GESTURES, released)


def _said(of: Evidences, name: str, module: Judged) -> Answers:
    """The joint answers of a network and its second opinion."""
    return of[name].answers(module.decision, module.verifier)


def _evidence(nets: nn.ModuleDict, samples: Samples) -> Evidences:
    return {name: Evidence.of(nets, name, samples) for name in nets if name != "trajectory"}


def _joined(parts: Sequence[Evidences]) -> Evidences:
    return {name: Evidence.join([part[name] for part in parts]) for name in parts[0]}


def as_in_sessions(samples: Samples) -> NDArray[np.int64]:
    """Indices of all gestures, and of as many non-gestures as give a share of `OTHERS`, or of all that there are."""
    others = np.flatnonzero(samples.labels == NONE)
    gestures = np.flatnonzero(samples.labels != NONE)
    count = round(len(gestures) * OTHERS / (1 - OTHERS))
    return np.sort(np.concatenate([gestures, np.random.default_rng(1).permutation(others)[:count]]))
