"""Gestures of the user's own, as each model sees them: their examples embedded by it, and compared with a segment."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gestured.core.classifier import NEAR, Match
from gestured.core.errors import ModelError
from gestured.core.frames import Segment
from gestured.core.own import Example, Examples
from gestured.core.prototypes import Array, Prototype, Space, clashes, nearest
from gestured.model.model import RUN_S, Model


@dataclass(frozen=True, slots=True, eq=False)
class Bank:
    """The prototypes of one model."""

    space: Space
    prototypes: Mapping[str, Prototype]
    doubtful: tuple[str, ...]  # sentences: which gestures this model cannot tell apart


class Own:
    """A list of gestures, and what each model that has answered makes of it."""

    def __init__(self, gestures: Examples) -> None:
        self.gestures = dict(gestures)
        self._banks: dict[str, Bank | None] = {}  # by the model's sha256

    def match(self, model: Model, segment: Segment) -> Match | None:
        """The nearest of them; None where the model has no embedding, or fails: its own answer is none the worse."""
        bank = self.bank(model)
        if bank is None:
            return None
        try:
            return nearest(bank.space, bank.prototypes, place(model, bank.space, segment))
        except ModelError:
            return None

    def bank(self, model: Model) -> Bank | None:
        """The prototypes of a model, made when it is first asked; None for one that has no embedding."""
        if model.space is None:
            return None
        if model.sha256 not in self._banks:
            try:
                self._banks[model.sha256] = self._made(model, model.space)
            except ModelError:
                self._banks[model.sha256] = None
        return self._banks[model.sha256]

    def made(self, model: Model) -> Bank | None:
        """The prototypes of a model that was asked already; any thread may look."""
        return self._banks.get(model.sha256)

    def _made(self, model: Model, space: Space) -> Bank:
        places = {name: places_of(model, space, examples) for name, examples in self.gestures.items()}
        prototypes = {name: Prototype.of(space, found) for name, found in places.items()}
        doubtful = [f"{one} may be taken for {other}" for one, other in clashes(prototypes, places)]
        for name, examples in self.gestures.items():
            taken = (taken_for(model, space, one.segment(), model.gestures) for one in examples)
            doubtful += sorted({f"{name} may be taken for the model's {found[0]}" for found in taken if found})
        return Bank(space, prototypes, tuple(doubtful))


def places_of(model: Model, space: Space, examples: Sequence[Example]) -> Array:
    """(n, K) places of examples. Raises ModelError where the model fails."""
    return np.stack([place(model, space, one.segment()) for one in examples])


def place(model: Model, space: Space, segment: Segment) -> Array:
    """(K,) place of a segment. Raises ModelError where the model fails, or the segment is not finite."""
    with np.errstate(all="ignore"):  # counts near the limits of float32 overflow; checked below
        window: NDArray[np.float32] = model.metadata.window.apply(segment)
        if not (len(window) and np.isfinite(segment.frames).all() and np.isfinite(window).all()):
            raise ModelError(f"{model.name}: a segment that is empty or not finite has no embedding")
    try:
        return space.place(model.embed(window[np.newaxis], RUN_S)[0].astype(np.float64))
    except ValueError as error:
        raise ModelError(f"{model.name}: {error}") from error


def taken_for(model: Model, space: Space, segment: Segment, in_use: Collection[str]) -> tuple[str, float] | None:
    """The model's gesture that it takes a segment for, and how surely, where the user's own could not take it."""
    scores = model.classify(segment)
    best = model.gestures[int(scores.values.argmax())]
    if scores.confidence < scores.threshold or best not in in_use:
        return None
    return (best, scores.confidence) if space.claimed(place(model, space, segment)) else None


class Examiner:
    """A model that judges the examples of an enrolment; implements `Judge`."""

    def __init__(self, model: Model, space: Space, own: Own, in_use: Collection[str]) -> None:
        """`own` are the gestures that there are already, `in_use` the model's."""
        self._model, self._space, self._own, self._in_use = model, space, own, in_use

    def example(self, segment: Segment) -> Example | None:
        """A segment as it is kept; None for one that is too long."""
        return Example.of(segment, self._model.metadata.window)

    def same_as(self, example: Example) -> str | None:
        """The gesture that there is already, and how near."""
        segment = example.segment()
        taken = taken_for(self._model, self._space, segment, self._in_use)
        if taken is not None:
            return f"{taken[0]} ({taken[1]:.2f})"
        match = self._own.match(self._model, segment)
        return None if match is None or match.confidence < NEAR else f"{match.name} ({match.confidence:.2f})"

    def unlike(self, example: Example, kept: Sequence[Example]) -> str | None:
        """How near it is to those that were kept, where that is not near enough."""
        prototype = Prototype.of(self._space, places_of(self._model, self._space, kept))
        confidence = prototype.confidence(place(self._model, self._space, example.segment()))
        return None if confidence >= NEAR else f"{confidence:.2f}, expected {NEAR:.2f}"
