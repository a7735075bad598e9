"""Gestures of the user's own, as each model sees them: their examples embedded by it, and compared with a segment."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from gestured.core.classifier import Match
from gestured.core.errors import ModelError
from gestured.core.frames import Segment
from gestured.core.own import Example, Examples
from gestured.model.model import RUN_S, Model
from gestured.model.prototypes import Array, Prototype, Space, clashes, nearest


@dataclass(frozen=True, slots=True, eq=False)
class PrototypeSet:
    """The prototypes of one model."""

    space: Space
    prototypes: Mapping[str, Prototype]
    doubtful: tuple[str, ...]  # sentences that say which gestures this model cannot tell apart


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """The place of a segment in the space of one model, and what the model takes the segment for."""

    place: Array  # (K,)
    taken: tuple[str, float] | None  # the model's gesture and its confidence, if no own gesture could take the segment

    @classmethod
    def of(cls, model: Model, space: Space, segment: Segment) -> "Placed":
        """What a model makes of a segment. Raises ModelError if the model fails, or the segment is not finite."""
        scores, where = model.classify(segment), place(model, space, segment)
        sure = scores.confidence >= scores.threshold and space.claimed(where)
        return cls(where, (model.gestures[int(scores.values.argmax())], scores.confidence) if sure else None)


# What models have made of examples, kept as long as both are in use, since each takes some runs of the model.
_placed: WeakKeyDictionary[Model, WeakKeyDictionary[Example, Placed]] = WeakKeyDictionary()


class Own:
    """The user's own gestures, and the prototypes of them that each model has made."""

    def __init__(self, gestures: Examples, known: Collection[str] = ()) -> None:
        """`known` are the model's gestures: an own gesture with such a name is hidden."""
        self.gestures = {name: examples for name, examples in gestures.items() if name not in known}
        self.hidden = tuple(name for name in gestures if name in known)
        self.missing: Callable[[Model], None] = self.make  # called when a model that has no prototypes yet answers
        self._banks: WeakKeyDictionary[Model, PrototypeSet | None] = WeakKeyDictionary()

    def match(self, model: Model, segment: Segment) -> Match | None:
        """The own gesture that is nearest to a segment; None if the model has no embedding, or fails to give one."""
        bank = self._bank(model)
        if bank is None:
            return None
        try:
            return nearest(bank.space, bank.prototypes, place(model, bank.space, segment))
        except ModelError:
            return None

    def nearest_to(self, model: Model, example: Example) -> Match | None:
        """The own gesture that is nearest to an example, as `match` gives it. Raises ModelError if the model fails."""
        bank = self._bank(model)
        return None if bank is None else nearest(bank.space, bank.prototypes, placed(model, bank.space, example).place)

    def make(self, model: Model) -> None:
        """Make the prototypes of a model; any thread may. It takes up to a second for each model and list."""
        bank: PrototypeSet | None = None
        if model.space is not None:
            try:
                bank = self._made(model, model.space)
            except ModelError:
                pass  # a model that fails has no prototypes
        self._banks[model] = bank

    def made(self, model: Model) -> PrototypeSet | None:
        """The prototypes of a model, None before they are made; any thread may ask."""
        return self._banks.get(model)

    def _bank(self, model: Model) -> PrototypeSet | None:
        if model.space is not None and self.gestures and model not in self._banks:
            self.missing(model)
        return self._banks.get(model)

    def _made(self, model: Model, space: Space) -> PrototypeSet:
        looked = {name: [placed(model, space, one) for one in examples] for name, examples in self.gestures.items()}
        places = {name: np.stack([one.place for one in found]) for name, found in looked.items()}
        prototypes = {name: Prototype.of(space, found) for name, found in places.items()}
        doubtful = [f"{one} may be taken for {other}" for one, other in clashes(prototypes, places)]
        for name, found in looked.items():
            taken = {one.taken[0] for one in found if one.taken}
            doubtful += sorted(f"{name} may be taken for the model's {gesture}" for gesture in taken)
        return PrototypeSet(space, prototypes, tuple(doubtful))


def placed(model: Model, space: Space, example: Example) -> Placed:
    """What a model makes of an example, found out only once. Raises ModelError if the model fails."""
    known = _placed.setdefault(model, WeakKeyDictionary())
    found = known.get(example)
    if found is None:
        found = known[example] = Placed.of(model, space, example.segment())
    return found


def place(model: Model, space: Space, segment: Segment) -> Array:
    """The place (K,) of a segment. Raises ModelError if the model fails, or the segment is empty or not finite."""
    with np.errstate(all="ignore"):  # counts near the limits of float32 overflow; checked below
        window: NDArray[np.float32] = model.metadata.window.apply(segment)
        if not (len(window) and np.isfinite(segment.frames).all() and np.isfinite(window).all()):
            raise ModelError(f"{model.name}: a segment that is empty or not finite has no embedding")
    try:
        return space.place(model.embed(window[np.newaxis], RUN_S)[0].astype(np.float64))
    except ValueError as error:
        raise ModelError(f"{model.name}: {error}") from error
