"""Silence: a model learns from hours on a user's own sensor in which nobody made a gesture.

The networks stay as they are. The verifier, which decides whether a gesture was meant, learns further: all contacts of
the tapes were not meant, and all gestures of the recordings were. A gesture in a recording session follows a pause, so
each of them is given the past of some contact of the tapes. Gestures that the recordings lack are simulated, so that
they are not forgotten; more simulated ones would only blur what this sensor and these people show.

People and tapes are held out in turn, and each is judged by a verifier that has not learned from it. Both models are
compared at thresholds at which as many gestures are right. The model that is written has learned from all; its
operating points are chosen on the answers to what was held out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import from_numpy, nn

from gestured.core.errors import GesturedError, RecordingError
from gestured.core.front_end import Cut, FrontEnd
from gestured.core.points import USUAL
from gestured.core.sensor import ABSENT_S
from gestured.core.timing import Timing
from gestured.lab import decide
from gestured.lab.adapt.learning import Simulated, opinions
from gestured.lab.adapt.material import FEWEST, GROUPS, Own, dealt, held_out
from gestured.lab.adapt.weights import Base
from gestured.lab.early import Foretold, published
from gestured.lab.everyday.hours import points_of, thresholds
from gestured.lab.everyday.stretches import HOUR_S, Stretch, recorded
from gestured.lab.fit import targets
from gestured.lab.intervals import interval, rate
from gestured.lab.nets import Judged, Verifier
from gestured.lab.points import operating_points
from gestured.lab.samples import EVERYDAY, Sample, Samples, collect, join, sample
from gestured.lab.verifier import Evidence, fit_verifier, taught, with_past_of
from gestured.simulator import GESTURES, NONE

LEAST_HOURS = 1.0  # of tapes; fewer hardly show what people do besides gestures
ENOUGH = 5  # performances of a gesture that need no simulated ones beside them
AN_HOUR = 35.0  # gestures, in the hours for which the costs of false gestures were chosen (`points.COSTS`)


@dataclass(frozen=True)
class Lived:
    """Contacts of tapes in which nobody made a gesture."""

    samples: Samples  # of the kind EVERYDAY; `people` are places in `hours`
    hours: NDArray[np.float64]  # (U,) h on all sensors of each tape; with only one tape, of equal parts of it
    unit: str  # what each of these hours is of: "tapes", or "parts of one tape"


def own_hours(paths: Sequence[Path], grid: tuple[int, ...]) -> Lived:
    """Read and cut tapes. Raises RecordingError or GesturedError if nothing can be learned from them."""
    contacts, places, seconds = list[Sample](), list[float](), [0.0] * len(paths)
    for n, path in enumerate(paths):
        for life in recorded(path):  # one person may touch all its sensors at once, so they are one unit
            assert life.setup.grid is not None
            if life.setup.grid != grid:
                here, others = ("x".join(map(str, shape)) for shape in (life.setup.grid, grid))
                raise RecordingError(f"{path}: expected the grid {others} of the recordings, found {here}")
            more, onsets, lasted = _contacts(life)
            contacts += [one._replace(person=n) for one in more]
            places += (onsets * GROUPS / max(lasted, 1.0)).tolist()
            seconds[n] += lasted
    unit = "tapes"
    if len(paths) == 1:
        unit, seconds = "parts of one tape", [seconds[0] / GROUPS] * GROUPS
        parts = [min(int(place), GROUPS - 1) for place in places]
        contacts = [one._replace(person=part) for one, part in zip(contacts, parts, strict=True)]
    hours = np.array(seconds) / HOUR_S
    samples = collect(sorted(contacts, key=lambda one: one.person))
    if hours.sum() < LEAST_HOURS or len(samples) < FEWEST:
        raise GesturedError(
            f"{', '.join(map(str, paths))}: expected at least {LEAST_HOURS:g} h of tapes with {FEWEST} contacts in "
            f"which nobody made a gesture, found {hours.sum():.2g} h with {len(samples)}"
        )
    return Lived(samples, hours, unit)


def _contacts(life: Stretch) -> tuple[list[Sample], NDArray[np.float64], float]:
    """The contacts of a stretch, their onsets in s since its first frame, and its length in s, without its silences."""
    assert life.setup.grid is not None
    front = FrontEnd(*life.setup.grid, mounting=life.setup.mounting, timing=Timing(tap_gap_s=life.tap_gap_s))
    segments, times = [], []
    for frame in life.frames:
        times.append(frame.t)
        segments += [found.segment for found in front.push(frame) if isinstance(found, Cut)]
    heard = np.cumsum(np.minimum(np.diff(times, prepend=times[:1]), ABSENT_S))
    onsets = np.interp([segment.onset for segment in segments], times, heard) if segments else np.zeros(0)
    return [sample(segment, NONE, EVERYDAY, 0) for segment in segments], onsets, float(heard[-1]) if times else 0.0


class Cost(NamedTuple):
    """What a model answers where it has not learned; each figure with the ends of its 95 % interval."""

    false: tuple[float, float, float]  # false gestures an hour
    right: tuple[float, float, float]  # shares of the gestures that were performed
    wrong: tuple[float, float, float]

    def as_dict(self) -> dict[str, Any]:
        """The figures as JSON values."""
        named = {"false_per_hour": self.false, "right": self.right, "wrong": self.wrong}
        rounded = {name: [round(float(value), 4) for value in of] for name, of in named.items()}
        return {name: dict(zip(("is", "low", "high"), of, strict=True)) for name, of in rounded.items()}


class _Heard:
    """Gestures of recordings, then contacts of tapes, and how answers to them are judged."""

    def __init__(self, own: Own, lived: Lived) -> None:
        people, tapes = held_out(own), np.arange(len(lived.hours))
        of_tape = dealt(tapes, np.bincount(lived.samples.people, minlength=len(tapes)))
        self.samples = join([own.samples, lived.samples])
        group = [people.of_samples, np.array([of_tape[n] for n in lived.samples.people.tolist()], np.int64)]
        self.groups = min(int(one.max()) for one in group) + 1
        self.group = np.concatenate(group) % self.groups
        self.unit, self.performed = people.unit, own.performed
        self._people, self._lived = people, lived
        self._known = self.samples.labels != NONE
        self._false = np.arange(len(self.samples)) >= len(own.samples)
        self._of = targets(self.samples)

    def right(self, answers: decide.Answers) -> NDArray[np.bool_]:
        """(N,) whether the best gesture of each answer was performed."""
        return np.asarray(self._known & (answers[0].argmax(axis=1) == self._of))

    def alike(self, answers: decide.Answers, count: int) -> Cost:
        """What answers cost at the highest threshold at which `count` of them are right, or as many as there are."""
        sure = decide.confidence(answers)
        rightly = np.sort(sure[self.right(answers)])[::-1]
        return self.cost(answers, sure >= (rightly[min(count, len(rightly)) - 1] if count and len(rightly) else 1.0))

    def cost(self, answers: decide.Answers, said: NDArray[np.bool_]) -> Cost:
        """What answers cost of which these (N,) are published."""
        right = said & self.right(answers)
        wrong, false = said & self._known & ~right, said & self._false
        hours = self._lived.hours
        gestures, lost = self._known[~self._false], np.zeros(len(self._people.unit_of_missed), bool)
        units = np.concatenate([self._people.unit_of_samples[gestures], self._people.unit_of_missed])
        shares = [interval(np.concatenate([of[self._known], lost]), units) for of in (right, wrong)]
        count = np.bincount(self._lived.samples.people, false[self._false], len(hours))
        return Cost((float(count.sum() / hours.sum()), *rate(count, hours)), shares[0], shares[1])


@dataclass(frozen=True)
class Quieter:
    """A model that has learned from own hours, and what that is worth."""

    judged: Judged
    least: float  # the confidence from which an answer is published without an operating point
    points: Mapping[str, Any]  # the metadata `operating_points`
    provisional: Mapping[str, Any]  # the rule for provisional events
    lived: Lived
    unit: str  # what was held out in turn, of the recordings
    known: NDArray[np.bool_]  # (N,) whether a sample is a gesture
    confidence: NDArray[np.float64]  # (N,) of the answer to it, by a verifier that has not learned from it
    before: Cost  # the old model at its usual operating point
    moved: Cost  # the old model at one threshold at which as many gestures are right
    after: Cost  # the new model at such a threshold

    @property
    def hours(self) -> float:
        """The length of the tapes in hours."""
        return float(self.lived.hours.sum())

    def answered(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(N,) the confidence of each answer to what was held out, and whether it was a gesture."""
        return self.confidence, self.known

    def reasons(self) -> list[str]:
        """Why the new model is no better than the old one; empty if it is."""
        found = []
        old, new = min(self.before.false[0], self.moved.false[0]), self.after.false[0]
        if not new < old:
            found.append(f"false gestures do not go down ({old:.2f} -> {new:.2f} an hour)")
        if self.after.right[0] < self.before.right[0]:
            found.append(f"right goes down ({self.before.right[0]:.3f} -> {self.after.right[0]:.3f})")
        return found


def quieter(base: Base, own: Own, lived: Lived, takes: Simulated) -> Quieter:
    """Let the verifier of a model learn from own hours, and judge it before and after."""
    old = base.judged.verifier
    assert old is not None
    heard = _Heard(own, lived)
    evidence = Evidence.join(
        [opinions(base.judged, own.samples).beside(with_past_of(own.samples, lived.samples, 1)),
         opinions(base.judged, lived.samples)]
    )  # fmt: skip
    kinds = taught(heard.samples)
    lacking = _lacking(own.samples, takes.teach)
    made = []
    if len(lacking):
        past = with_past_of(lacking, lived.samples, 2)
        made.append((opinions(base.judged, lacking).beside(past), taught(lacking)))

    def learned(rows: NDArray[np.bool_]) -> Verifier:
        mine = evidence.take(from_numpy(rows)), kinds[rows]
        return fit_verifier(base.judged.decision, [mine, *made], 1, old)

    said = evidence.answers(base.judged.decision, old)
    scores, unknown = said[0].copy(), said[1].copy()
    for k in range(heard.groups):
        held = heard.group == k
        of = evidence.take(from_numpy(held)).answers(base.judged.decision, learned(~held))
        scores[held], unknown[held] = of
    new = scores, unknown
    judged = Judged(base.judged.net, base.judged.trajectory, base.judged.decision, learned(kinds >= 0)).eval()
    hours = float(lived.hours.sum())
    points = operating_points(new, heard.samples, own.performed, hours, own.performed / AN_HOUR / hours)
    asked = nn.ModuleDict({"net": judged.net, "trajectory": judged.trajectory})
    least = thresholds(points[USUAL]["thresholds"])
    provisional = Foretold.sessions([(asked, takes.check), (asked, takes.early)]).rule("net", judged, least)
    usual = published(said, thresholds(points_of(base.model)[USUAL])) >= 0
    as_many = int((heard.right(said) & usual).sum())
    return Quieter(
        judged, base.model.threshold, points, provisional, lived, heard.unit,
        heard.samples.labels != NONE, decide.confidence(new).astype(np.float64),
        heard.cost(said, usual), heard.alike(said, as_many), heard.alike(new, as_many),
    )  # fmt: skip


def _lacking(own: Samples, takes: Samples) -> Samples:
    """Simulated performances of each gesture that was hardly recorded, as many as of the others on average."""
    count = {name: int((own.labels == name).sum()) for name in GESTURES}
    there = [n for n in count.values() if n >= ENOUGH]
    most = round(sum(there) / len(there)) if there else ENOUGH
    lacking = [name for name in GESTURES if count[name] < ENOUGH]
    rows = [np.flatnonzero(takes.labels == name)[:most] for name in lacking]
    return takes.take(np.concatenate([np.zeros(0, np.int64), *rows]))
