"""What networks say of contacts before they are over, for the thresholds of provisional events to be learned from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import nn

from gestured.core.scene import DOUBLE_TAP, ONE_TAP
from gestured.lab.decide import Answers
from gestured.lab.early import Asked, at_release, calibrated, published, tap_threshold
from gestured.lab.nets import Judged
from gestured.lab.prefixes import prefixes
from gestured.lab.samples import WINDOW, Samples, join
from gestured.lab.verifier import Evidence
from gestured.simulator import GESTURES, NONE

Evidences = Mapping[str, Evidence]  # by network, each with the trajectory net beside it
OTHERS = 0.2  # share of non-gestures among what is performed, as in the sessions of `gestured.lab.online`


@dataclass(frozen=True, slots=True)
class Foretold:
    """Samples of people who were held out, with what each network makes of them."""

    samples: Samples
    whole: Evidences
    released: Evidences  # when the finger has left for the first time
    prefixes: Evidences  # at every touched frame
    contact: NDArray[np.int64]  # (N,) whose prefix each is
    since: NDArray[np.int64]  # (N,) frames since its onset
    second: NDArray[np.bool_]  # (N,) whether the finger had left and come back

    @classmethod
    def sessions(cls, parts: Sequence[tuple[nn.ModuleDict, Samples]]) -> "Foretold":
        """As `of`, with so many non-gestures of each part as sessions hold (`OTHERS`), drawn at random."""
        return cls.of([(nets, samples.take(as_in_sessions(samples))) for nets, samples in parts])

    @classmethod
    def of(cls, parts: Sequence[tuple[nn.ModuleDict, Samples]]) -> "Foretold":
        """Ask each part's networks about its samples."""
        whole: list[Evidences] = []
        released: list[Evidences] = []
        early: list[Evidences] = []
        contact, since, second, before = [], [], [], 0
        for nets, samples in parts:
            cut, of, frames = prefixes(samples, np.arange(len(samples)))
            whole.append(_evidence(nets, samples))
            released.append(_evidence(nets, at_release(samples)))
            early.append(_evidence(nets, cut))
            contact.append(of + before)
            since.append(frames)
            asked_before = np.arange(len(of)) - np.searchsorted(of, of)
            second.append(frames > asked_before)  # at some frame it was not touched
            before += len(samples)
        together = join([samples for _, samples in parts])
        contacts = np.concatenate(contact), np.concatenate(since), np.concatenate(second)
        return cls(together, _joined(whole), _joined(released), _joined(early), *contacts)

    def rule(self, name: str, module: Judged, least: float | NDArray[np.float64]) -> dict[str, Any]:
        """The metadata `provisional` of a network that publishes from `least` on, for all or (G,) of each gesture."""
        scores, unknown = _said(self.prefixes, name, module)
        final = published(_said(self.whole, name, module), least)
        best, confidence = scores.argmax(axis=1), scores.max(axis=1).astype(np.float64) * (1 - unknown)
        # As the run time has it: no tap while the finger is down, and in a second contact two taps or nothing.
        tap, two_taps = GESTURES.index(ONE_TAP), best == GESTURES.index(DOUBLE_TAP)
        confidence[(two_taps != self.second) | (best == tap)] = 0.0
        asked = Asked(self.contact, self.since / WINDOW.rate_hz, best, confidence, final, self.samples.people)
        # Where the finger comes back nobody can know it at the release: that depends on how often people do so.
        single = at_release(self.samples).lengths() == self.samples.lengths()
        scores, unknown = _said(self.released, name, module)
        people = self.samples.people[single]
        released = tap_threshold((scores[single], unknown[single]), final[single], people, tap)
        return calibrated(asked, GESTURES, released)


def _said(of: Evidences, name: str, module: Judged) -> Answers:
    """What a network and its second opinion answer together."""
    return of[name].answers(module.decision, module.verifier)


def _evidence(nets: nn.ModuleDict, samples: Samples) -> Evidences:
    return {name: Evidence.of(nets, name, samples) for name in nets if name != "trajectory"}


def _joined(parts: Sequence[Evidences]) -> Evidences:
    return {name: Evidence.join([part[name] for part in parts]) for name in parts[0]}


def as_in_sessions(samples: Samples) -> NDArray[np.int64]:
    """Indices of all gestures, and of so many non-gestures that these are `OTHERS` of all, or of all that there are."""
    others = np.flatnonzero(samples.labels == NONE)
    gestures = np.flatnonzero(samples.labels != NONE)
    count = round(len(gestures) * OTHERS / (1 - OTHERS))
    return np.sort(np.concatenate([gestures, np.random.default_rng(1).permutation(others)[:count]]))
