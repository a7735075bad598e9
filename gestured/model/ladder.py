"""The ladder: a model and its fallbacks, best first, as one classifier."""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gestured.core.classifier import Scores
from gestured.core.errors import ModelError, SettingsError
from gestured.core.frames import Segment
from gestured.core.own import Examples, is_name
from gestured.core.points import USUAL, Certainty
from gestured.core.scene import Scene
from gestured.model.limit import hurry
from gestured.model.model import Model
from gestured.model.own import Own
from gestured.model.rung import OtherGestures, Rung
from gestured.model.shipped import LADDER, shipped, shipped_name

SLOW_S = 0.05  # a run that takes longer counts as slow, since it delays an answer; some milliseconds are usual
SLOW_RUNS = 3  # so many slow runs in a row put a rung aside; one may be the fault of another program
SLIP = 0.8  # difflib's ratio from which a name counts as a misspelt gesture of the model
RETRY_S = 30.0  # a rung is put aside for so long, since trying it again may delay another answer


class Ladder:
    """Models, best first, as one `Classifier`: a rung that fails hands the same segment to the next.

    A rung that raises or gives scores that are not finite is put aside for RETRY_S of `clock`, and then tried again.
    So is a rung that took more than `slow_s` seconds SLOW_RUNS times in a row. A rung that cannot be opened, or knows
    other gestures, is put aside for good. If no other rung can answer, those that are aside are tried before giving up.
    An answer of any rung but the first is `degraded`. The rung that answers also compares gestures of the user's own.
    """

    def __init__(
        self,
        rungs: Sequence[str | Path | Model],
        *,
        slow_s: float = SLOW_S,
        clock: Callable[[], float] = time.perf_counter,
        report: Callable[[str], None] | None = None,
    ) -> None:
        """Open the first rung that can be opened. Raises ModelError if none can.

        If `slow_s` is infinite, this ladder does not make the process end long runs (`limit.hurry`). `report` is
        called with a sentence that says what happened to a rung.
        """
        if not rungs:
            raise ModelError("a ladder needs at least one model")
        self.rungs = tuple(Rung(source) for source in rungs)
        self._slow_s, self._clock = slow_s, clock
        if slow_s < math.inf:
            hurry()
        self.report = report or (lambda sentence: None)
        self.failures = 0  # how often a rung was put aside
        self._faint = 0  # previews in a row that failed, or took too long
        self._previews_from = -math.inf  # s of `clock`; before this time there are no previews
        self.own = Own({})  # gestures of the user's own; may be replaced between two segments
        self._active, opened = self._first_open()
        self.gestures = opened.gestures
        self.rows, self.columns = opened.rows, opened.columns
        for rung in self.rungs:
            self._check_gestures(rung)

    def compared(self, examples: Examples) -> Own:
        """Own gestures with the prototypes of the model that answers. It takes up to a second to make them."""
        own = Own(examples, self.gestures)
        own.make(self.model)
        return own

    @property
    def name(self) -> str:
        """The name of the best rung, whether or not that rung can be used."""
        return self.rungs[0].name

    @property
    def active(self) -> str:
        """The name of the rung that answered last, or that would answer first."""
        return self._active.name

    @property
    def source(self) -> str:
        """The file, or the shipped name, of the active rung."""
        return str(self._active.source)

    @property
    def rung(self) -> int:
        """The index of the active rung; 0 is the best."""
        return self.rungs.index(self._active)

    @property
    def degraded(self) -> bool:
        """Whether the active rung is a fallback."""
        return self._active is not self.rungs[0]

    @property
    def refused(self) -> list[str]:
        """Why models cannot be used before a reload, a sentence for each such rung."""
        return [str(rung.refused) for rung in self.rungs if rung.refused is not None]

    @property
    def model(self) -> Model:
        """The active rung's model."""
        return self._active.open()

    def classify(self, segment: Segment) -> Scores:
        """The scores of the best rung that can give them. Raises ModelError if none can."""
        now = self._clock()
        ready = [rung for rung in self.rungs if now >= rung.aside_until]
        aside = [rung for rung in self.rungs if now < rung.aside_until]
        for rung in ready + aside:
            try:
                model = rung.open()
                self._require_same(rung, model.gestures)
                start = self._clock()
                scores = model.classify(segment)
                took = self._clock() - start
                if not (np.isfinite(scores.values).all() and math.isfinite(scores.unknown)):
                    raise ModelError(f"{rung.name}: gave scores that are not finite")
            except Exception as error:  # whatever makes a rung fail, the next one answers
                self._put_aside(rung, str(error) or type(error).__name__)
                continue
            rung.slow = rung.slow + 1 if took > self._slow_s else 0
            if rung.slow >= SLOW_RUNS:
                self._put_aside(rung, f"{SLOW_RUNS} runs in a row took more than {self._slow_s:g} s")
            if rung is not self._active:
                self.report(f"{rung.name} answers now")
                self._active = rung
            own = self.own.match(model, segment) if self.own.gestures else None
            return replace(scores, degraded=scores.degraded or self.degraded, took_s=took, own=own)
        raise ModelError(f"no model could classify: {', '.join(rung.name for rung in self.rungs)}")

    @property
    def certainty(self) -> Certainty | None:
        """How sure the active rung must be of a contact that is not over; None if it was not made for that."""
        return None if self._active.model is None else self._active.model.certainty

    def preview(self, segment: Segment) -> Scores | None:
        """The active rung's scores of the beginning of a segment, None if that fails.

        A preview puts no rung aside, tries none again and reports none. After SLOW_RUNS previews in a row that failed
        or were slow, there are none for RETRY_S.
        """
        model, start = self._active.model, self._clock()
        if model is None or start < self._previews_from:
            return None
        try:
            scores = model.classify(segment)
        except Exception:  # a preview that fails says nothing
            scores = None
        end = self._clock()
        self._faint = self._faint + 1 if scores is None or end - start > self._slow_s else 0
        if self._faint >= SLOW_RUNS:
            self._faint, self._previews_from = 0, end + RETRY_S
        return scores

    def report_missing_points(self, strictness: Iterable[str | None]) -> None:
        """Report if a `strictness` is set and the model that answers has no operating points."""
        if self.model.points is None and set(strictness) - {None, USUAL}:
            self.report(f"{self.active} has no operating points: whatever the strictness, it takes its one threshold")

    def require_gestures(self, names: Iterable[str], field: str = "gestures") -> None:
        """Raise SettingsError, which names the `field`, for a name that is none of the gestures."""
        for name in names:
            if name not in self.gestures:
                known = ", ".join(self.gestures)
                raise SettingsError(f"{field}: {name!r} is no gesture of {self.name}, expected any of {known}")

    def may_be_own(self, name: str) -> bool:
        """Whether a name may become that of a gesture of the user's own, and is no misspelt one of the models'."""
        from difflib import get_close_matches

        return is_name(name) and not get_close_matches(name, self.gestures, 1, SLIP)

    def gestures_in_use(self, chosen: Sequence[str] | None) -> tuple[str, ...]:
        """The chosen gestures in the models' order, all if `chosen` is None. Raises SettingsError."""
        if chosen is None:
            return self.gestures
        if isinstance(chosen, str):
            raise SettingsError(f"gestures: expected a list of names, such as [{chosen!r}], found {chosen!r}")
        self.require_gestures(chosen)
        if not chosen:
            raise SettingsError("gestures: an empty list, expected at least one gesture")
        return tuple(name for name in self.gestures if name in chosen)

    def _first_open(self) -> tuple[Rung, Model]:
        failed: list[tuple[Rung, str]] = []
        for rung in self.rungs:
            try:
                opened = rung.open()
            except ModelError as error:
                failed.append((rung, str(error)))
                continue
            for other, reason in failed:  # if no rung can be opened, the error below gives the reasons instead
                self._put_aside(other, reason)
            return rung, opened
        raise ModelError("; ".join(reason for _, reason in failed))

    def _check_gestures(self, rung: Rung) -> None:
        """Put a fallback aside that cannot be opened, or that knows other gestures."""
        try:
            self._require_same(rung, rung.gestures())
        except ModelError as error:
            if rung.aside_until == -math.inf:
                self._put_aside(rung, str(error))

    def _require_same(self, rung: Rung, gestures: Sequence[str]) -> None:
        if gestures != self.gestures:
            expected = f"expected the same gestures in the same order ({', '.join(self.gestures)})"
            said = f"{rung.name}: cannot stand in for {self._active.name}, {expected}, found {', '.join(gestures)}"
            rung.refuse(OtherGestures(said))

    def _put_aside(self, rung: Rung, reason: str) -> None:
        rung.slow = 0
        rung.aside_until = self._clock() + RETRY_S if rung.refused is None else math.inf
        self.failures += 1
        until = f"for {RETRY_S:g} s" if rung.refused is None else "until a reload"
        self.report(f"{rung.name} is put aside {until}: {reason}")


def ladder_for(source: str | Path, fallbacks: Sequence[str | Path] | None = None, **settings: Any) -> Ladder:
    """The ladder of a model with the named `fallbacks`; if None, the shipped ones below a shipped model, else none.

    `settings` are passed to `Ladder`. Raises ModelError.
    """
    if fallbacks is None:
        name = shipped_name(source)
        below = LADDER[LADDER.index(name) + 1 :] if name is not None else ()
        # Fallbacks are given by path, since a file of that name in the working directory is not the shipped one.
        fallbacks = [shipped()[rung] for rung in below]
    return Ladder([source, *fallbacks], **settings)


def require_arming(scene: Scene, known: Sequence[str]) -> None:
    """Raise SettingsError if a gesture that arms a sensor is not known, since no other would ever count."""
    for field, gesture in scene.arming_gestures.items():
        if gesture not in known:
            raise SettingsError(f"{field} = {gesture!r}: is no gesture in use, expected any of {', '.join(known)}")
