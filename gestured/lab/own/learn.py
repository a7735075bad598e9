"""The space in which a model compares examples of own gestures, learned from simulated enrolments.

Each kind that somebody could perform is in turn the new gesture, in a space that was learned from other people and
other kinds. Nothing else that this person does may be taken for the new gesture. `teach` writes the space into a
model's file.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

from gestured.core.errors import ModelError
from gestured.core.own import EXAMPLES
from gestured.lab.export import NAME, measured, write_manifest
from gestured.lab.own.play import PLAN, REPETITIONS, SIGNS, played
from gestured.lab.samples import Samples
from gestured.lab.written import write
from gestured.model.file import read_bytes, sealed
from gestured.model.model import Model
from gestured.model.prototypes import Array, Prototype, Space

# Share of other non-gestures that a threshold lets through in simulation, below the 0.02 that is promised.
ACCEPTED = 0.015
TAKEN = 0.003  # share of the model's gestures that may be taken for one own gesture in simulation
DIRECTIONS = 64  # the most directions of the embedding that are kept
TELLING = 0.05  # variance between gestures over that within one; a direction with less is dropped
DIAGONAL, EVEN = 0.1, 0.1  # shares of the diagonal and of a multiple of one in the pooled covariance: shrinkage
FOLDS = 5  # groups of kinds, each held out in turn


@dataclass(frozen=True, slots=True)
class Seen:
    """A model's answers to samples."""

    embedding: NDArray[np.float64]  # (N, E)
    best: NDArray[np.int64]  # (N,) the model's gesture
    known: NDArray[np.bool_]  # (N,) whether it would be published
    labels: NDArray[np.str_]
    kinds: NDArray[np.str_]
    people: NDArray[np.int64]
    gestures: tuple[str, ...]

    @classmethod
    def by(cls, model: Model, samples: Samples) -> "Seen":
        """Run a model on all samples, in batches of one length."""
        found = [(index, *model.run(batch), model.embed(batch)) for index, batch in samples.alike(len(samples))]
        index, *answers = (np.concatenate(of) for of in zip(*found, strict=True))
        scores, unknown, embedding = (of[np.argsort(index)] for of in answers)
        best, known = scores.argmax(axis=1), scores.max(axis=1) * (1 - unknown) >= model.threshold
        places = embedding.astype(np.float64)
        return cls(places, best, known, samples.labels, samples.kinds, samples.people, model.gestures)

    def plans(self) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """(N,) whether a sample is a repetition, and (N,) its plan: one person's one kind."""
        names = np.char.add(np.char.add(self.people.astype("U20"), "/"), self.kinds)
        return self.labels == PLAN, np.unique(names, return_inverse=True)[1]


def learn(seen: Seen) -> Space:
    """Learn the space, its thresholds, slope and margin."""
    everybody = np.ones(len(seen.labels), bool)
    space = _without_thresholds(seen, everybody)
    # The thresholds come from signs alone. The network has not learned signs, just as it has not learned what a user
    # enrols; kinds that it has learned would seem easier to tell apart than a user's gestures are.
    trials = [trial for trial in played_through(seen) if trial.fits and trial.kind in SIGNS]
    by_count = [[trial for trial in trials if trial.examples == count] for count in range(1, EXAMPLES + 1)]
    thresholds = tuple(
        float(np.quantile(np.concatenate([trial.others.own for trial in some]), 1.0 - ACCEPTED)) for some in by_count
    )
    ahead = [
        np.where(trial.gestures.own >= least, trial.gestures.own - trial.gestures.built_in, -np.inf)
        for some, least in zip(by_count, thresholds, strict=True)
        for trial in some
    ]
    margin = float(np.quantile(np.concatenate(ahead), 1.0 - TAKEN, method="higher"))
    return replace(space, thresholds=thresholds, slope=_slope(by_count, thresholds), margin=max(margin, 0.0))


def _slope(by_count: list[list["Trial"]], thresholds: tuple[float, ...]) -> float:
    """The slope of the confidence: of a logistic regression over how far samples lie above their threshold."""
    ahead = [
        np.concatenate([getattr(trial, part).own - least for trial in some])
        for part in ("others", "again")
        for some, least in zip(by_count, thresholds, strict=True)
    ]
    labels = np.repeat([0, 1], [sum(map(len, ahead[:EXAMPLES])), sum(map(len, ahead[EXAMPLES:]))])
    fitted = LogisticRegression(fit_intercept=False, class_weight="balanced", C=1e6)
    fitted.fit(np.concatenate(ahead)[:, np.newaxis], labels)
    return max(float(fitted.coef_[0, 0]), 1e-3)


@dataclass(frozen=True, slots=True)
class Near:
    """How near some samples of a person are to that person's new gesture."""

    own: Array  # (n,) nearness to the new gesture
    built_in: Array  # (n,) nearness to the nearest of the model's gestures
    known: NDArray[np.bool_]  # (n,) whether the model would publish one of its gestures

    def taken(self, threshold: float, margin: float) -> NDArray[np.bool_]:
        """(n,) whether a sample is answered with the new gesture."""
        return (self.own >= threshold) & (~self.known | (self.own - self.built_in >= margin))


@dataclass(frozen=True, slots=True)
class Trial:
    """One person's new gesture after a number of examples."""

    kind: str
    examples: int
    fits: bool  # whether it would be enrolled
    again: Near  # further repetitions
    others: Near  # other non-gestures
    gestures: Near  # the model's gestures


def played_through(seen: Seen, final: Space | None = None) -> Iterator[Trial]:
    """Every enrolment, in `final` or else in ten spaces, each learned from other people and other kinds."""
    plan, _ = seen.plans()
    people, kinds = np.unique(seen.people), np.unique(seen.kinds[plan])
    folds = np.array_split(np.random.default_rng(0).permutation(kinds), FOLDS)
    for fold in folds:
        for side in (0, 1):
            if final is None:
                space = _without_thresholds(seen, np.isin(seen.people, people[side::2]) & ~np.isin(seen.kinds, fold))
            else:
                space = final
            places = space.place(seen.embedding)
            built_in = space.built_in_nearness(places)
            for person in people[1 - side :: 2]:
                yield from _trials(seen, space, places, built_in, int(person), fold)


def _trials(
    seen: Seen, space: Space, places: Array, built_in: Array, person: int, kinds: NDArray[np.str_]
) -> Iterator[Trial]:
    his, plan = seen.people == person, seen.labels == PLAN
    gestures = his & np.isin(seen.labels, seen.gestures)
    for kind in kinds:
        mine = np.flatnonzero(his & plan & (seen.kinds == kind))
        if len(mine) < REPETITIONS - 2:  # too few repetitions were cut out whole
            continue
        others = his & ~gestures & (seen.kinds != kind)
        for count in range(1, EXAMPLES + 1):
            prototype = Prototype.of(space, places[mine[:count]])
            near = prototype.nearness(places)
            again = mine[EXAMPLES:]
            fits = not any(seen.known[i] and space.claimed(places[i]) for i in mine[:count])
            again_others_gestures = (
                Near(near[some], built_in[some], seen.known[some]) for some in (again, others, gestures)
            )
            yield Trial(str(kind), count, fits, *again_others_gestures)


def _without_thresholds(seen: Seen, chosen: NDArray[np.bool_]) -> Space:
    """The space of the chosen samples, without thresholds: mean, directions and variances."""
    plan, of = seen.plans()
    gestures = np.isin(seen.labels, seen.gestures)
    # Variation within one person: of a plan, and of a gesture made slowly or fast, here or there.
    means, spread = _pooled(seen.embedding, of, plan & chosen)
    within = _shrunk((spread + _pooled(seen.embedding, of, gestures & chosen)[1]) / 2)
    middle = means.mean(axis=0)
    between = np.cov(means.T) - spread / REPETITIONS
    whiten = np.linalg.inv(np.linalg.cholesky(within))
    values, vectors = np.linalg.eigh(whiten @ between @ whiten.T)
    kept = np.argsort(-values)[: min(DIRECTIONS, max(int((values > TELLING).sum()), 1))]
    directions = vectors[:, kept].T @ whiten
    places = (seen.embedding - middle) @ directions.T
    built_in = []
    for gesture in seen.gestures:
        own = places[chosen & (seen.labels == gesture)]
        built_in.append((own.mean(axis=0), own.var(axis=0) + 1.0 / len(own)))
    return Space(middle, directions, np.maximum(values[kept], 0.0), np.stack(built_in, 1), (0.0,) * EXAMPLES, 1.0, 0.0)


def _pooled(x: Array, of: NDArray[np.int64], chosen: NDArray[np.bool_]) -> tuple[Array, Array]:
    """The means (G, E) of the groups `of` that have chosen samples, and the covariance (E, E) within them."""
    x, inverse = x[chosen], np.unique(of[chosen], return_inverse=True)[1]
    count = np.bincount(inverse)
    means = np.stack([np.bincount(inverse, column) for column in x.T], 1) / count[:, np.newaxis]
    apart = x - means[inverse]
    return means, apart.T @ apart / max(len(x) - len(count), 1)


def _shrunk(covariance: Array) -> Array:
    """A covariance from few people, shrunk towards its diagonal and towards equal variances."""
    size = len(covariance)
    even = np.trace(covariance) / size * np.eye(size)
    return np.asarray((1.0 - DIAGONAL) * covariance + DIAGONAL * np.diag(np.diag(covariance)) + EVEN * even)


PEOPLE = 20  # to learn from
QUICK_PEOPLE = 3


def teach(path: Path, cache: Path, people: int, jobs: int) -> Space:
    """Learn the space of a model, write it into the model's file, and renew the manifest beside it.

    Raises ModelError for a model without an embedding.
    """
    space = learn(Seen.by(embedding_of(path), played(cache, people, jobs)))
    figures_of = {model.stem: measured(model) for model in path.parent.glob("*.onnx")}  # the graph stays the same
    proto = onnx.load(path)
    kept = {one.key: one.value for one in proto.metadata_props if one.key != "digest"} | {"own": space.to_json()}
    onnx.helper.set_model_props(proto, kept)
    data = sealed(proto.SerializeToString(deterministic=True))
    try:
        Model(data, path.stem)
    except ValueError as error:
        raise ModelError(f"{path}: not written: {error}") from error
    write(path, data)
    if path.with_name(NAME).exists():
        write_manifest(path.parent, figures_of)
    return space


def embedding_of(path: Path) -> Model:
    """A model that can compare examples, whether or not the manifest has its file. Raises ModelError for others."""
    try:
        model = Model(read_bytes(path), path.stem)
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from error
    if not model.embeds:
        raise ModelError(f"{path}: has no output 'embedding', expected a model that gestured-lab train made")
    return model
