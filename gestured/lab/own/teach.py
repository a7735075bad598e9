"""What a model needs to learn its user's own gestures, learned and written into its file."""

from pathlib import Path

import onnx

from gestured.core.errors import ModelError
from gestured.lab.manifest import NAME, measured, write_manifest
from gestured.lab.own.learn import Seen, learn
from gestured.lab.own.play import played
from gestured.model.file import read_bytes, sealed
from gestured.model.model import Model
from gestured.model.prototypes import Space
from gestured.record.files import PUBLIC, atomic_write

PEOPLE = 20  # to learn from
QUICK_PEOPLE = 3


def teach(path: Path, cache: Path, people: int, jobs: int) -> Space:
    """Learn the space of a model that has an embedding, and write it into its file, and its manifest anew.

    Raises ModelError for a model without one.
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
    with atomic_write(path, PUBLIC) as file:
        file.write(data)
    if path.with_name(NAME).exists():
        write_manifest(path.parent, figures_of)
    return space


def open_file(path: Path) -> Model:
    """A model that was made here; whether its file is the one in the manifest does not matter. Raises ModelError."""
    try:
        return Model(read_bytes(path), path.stem)
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from error


def embedding_of(path: Path) -> Model:
    """A model that can compare examples; ModelError for one that has no embedding."""
    model = open_file(path)
    if not model.embeds:
        raise ModelError(f"{path}: has no output 'embedding', expected a model that gestured-lab train made")
    return model
