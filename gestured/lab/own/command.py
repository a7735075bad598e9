"""`gestured-lab own`: what a model needs to learn its user's own gestures, learned and written into its file."""

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import onnx

from gestured.core.errors import ModelError
from gestured.lab.manifest import NAME, measured, write_manifest
from gestured.lab.own.learn import Figures, Seen, figures, learn, played_through
from gestured.lab.own.play import played
from gestured.lab.own.signs import JUDGED
from gestured.model.file import read_bytes, sealed
from gestured.model.model import Model
from gestured.model.prototypes import Space
from gestured.record.files import PUBLIC, atomic_write

PEOPLE, JUDGES = 20, 12  # people to learn from, and others to judge by
QUICK_PEOPLE = 3


def run(args: argparse.Namespace) -> int:
    """Learn it for each model, write it, and print what enrolment is worth then."""
    people, judges = (QUICK_PEOPLE, QUICK_PEOPLE) if args.quick else (PEOPLE, JUDGES)
    told: dict[str, Any] = {}
    for path in args.models:
        space = teach(path, args.cache, people, args.jobs)
        samples = played(args.cache, judges, args.jobs, judge=True)
        seen = Seen.by(_embedding(path), samples)
        found = figures(space, (trial for trial in played_through(seen, space) if trial.kind in JUDGED))
        told[str(path)] = {"prototypes": [asdict(one) for one in found]}
        if not args.json:
            print(table(path.stem, found), flush=True)
    if args.json:
        print(json.dumps(told, indent=2))
    return 0


def teach(path: Path, cache: Path, people: int, jobs: int) -> Space:
    """Learn the space of a model that has an embedding, and write it into its file, and its manifest anew.

    Raises ModelError for a model without one.
    """
    space = learn(Seen.by(_embedding(path), played(cache, people, jobs)))
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


def _embedding(path: Path) -> Model:
    model = open_file(path)
    if not model.embeds:
        raise ModelError(f"{path}: has no output 'embedding', expected a model that gestured-lab train made")
    return model


def table(name: str, found: list[Figures]) -> str:
    """The figures for a person."""
    head = f"{'examples':<10}{'can be enrolled':>17}{'recall':>10}{'others accepted':>17}{'built-in taken':>17}"
    lines = [f"{name}: gestures that nobody has enrolled before, of people whom nothing was learned from", head]
    lines += [
        f"{one.examples:<10}{one.enrolled:>17.3f}{one.recall:>10.3f}{one.accepted:>17.4f}{one.taken:>17.4f}"
        for one in found
    ]
    return "\n".join(lines)
