"""`gestured-lab train` and `gestured-lab evaluate`."""

import argparse
import json
import sys
import time
from typing import Any

import torch

from gestured.client.say import say
from gestured.core.errors import GesturedError
from gestured.lab.cards import table, write_blocks, write_cards
from gestured.lab.evaluate import real_figures, simulated_figures
from gestured.lab.export import measured, plain, write_manifest
from gestured.lab.fit import RECURRENT
from gestured.lab.made_of import require_marks
from gestured.lab.own import learn as own
from gestured.lab.recordings.origin import origins, said
from gestured.lab.train import REAL_FILES, TrainingPlan, load_data, train
from gestured.lab.written import printed
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER


def run(args: argparse.Namespace) -> int:
    """Train or evaluate; marks and folders are checked first, since the work takes half an hour."""
    if args.command == "evaluate" and args.document:
        require_marks("figures", args.document[0])
        require_marks("worst", *args.document[1:])
    args.cache.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(args.jobs)
    plan = TrainingPlan.quick() if args.quick else TrainingPlan()
    if args.command == "train":
        args.out.mkdir(parents=True, exist_ok=True)
        train_models(plan, args)
        args.models, args.document = args.out, None
    evaluate_models(plan, args)
    return 0


def train_models(plan: TrainingPlan, args: argparse.Namespace) -> None:
    """Train the models and export them."""
    start = time.monotonic()
    train(plan, args.out, args.cache, args.real, args.jobs, args.recordings)
    minutes = (time.monotonic() - start) / 60
    say(f"trained in {minutes:.1f} minutes (finished steps are taken from {args.cache})", to=sys.stderr)
    for name in RECURRENT:
        people = own.QUICK_PEOPLE if args.quick else own.PEOPLE
        own.teach(args.out / f"{name}.onnx", args.cache, people, args.jobs)


def evaluate_models(plan: TrainingPlan, args: argparse.Namespace) -> None:
    """Print the figures, and keep them in the manifest, the cards and a document."""
    paths = {name: args.models / f"{name}.onnx" for name in LADDER}
    models = {name: open_model(path) for name, path in paths.items()}  # a faulty model is found before any work
    before = {name: measured(path) for name, path in paths.items()}
    given = {one["sha256"] for one in origins(args.recordings)}
    for name, path in paths.items():
        own = [one for one in said(path) or [] if one.file not in REAL_FILES]
        if given and given != {one.sha256 for one in own}:
            files = ", ".join(one.file for one in own) or "none"
            raise GesturedError(
                f"--recordings: expected the files that {name} learned from ({files}); gesturectl tune and replay "
                "judge it by others"
            )
    data = load_data(plan, args.cache, args.real, args.jobs, args.recordings)
    found = simulated_figures(models, data)
    figures: dict[str, dict[str, Any]] = {name: {"simulated": of} for name, of in found.items()}
    for name, of in real_figures(plan, data, args.cache).items():
        figures[name]["real"] = of
    printed(json.dumps(plain(figures), indent=2) if args.json else "\n".join(table(figures)))
    if args.quick and args.command == "evaluate":  # a card describes the plan that trained its model
        say("cards and manifest stay as they are: --quick judges too few gestures for them", to=sys.stderr)
    else:
        kept = plain({name: before[name] | of for name, of in figures.items()})  # real figures stay without new ones
        write_manifest(args.models, kept)
        write_cards(args.models, kept, plan)
    if args.document:
        write_blocks(args.document, args.models, figures, args.words)
