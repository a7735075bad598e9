"""`gestured-lab train` and `evaluate`, put together."""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import torch

from gestured.lab.cards import write_block, write_cards
from gestured.lab.evaluate import Evaluation, print_curve, real_figures, simulated_figures
from gestured.lab.manifest import write_manifest
from gestured.lab.own import command as own
from gestured.lab.own.command import open_file, teach
from gestured.lab.train import TrainingPlan, calibration_set, learn, load_data, train
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER


def run(args: argparse.Namespace) -> int:
    """Either of the two; a folder that cannot be made is told of now, and not after half an hour."""
    args.cache.mkdir(parents=True, exist_ok=True)
    if args.command == "evaluate":
        return evaluate_models(args)
    args.out.mkdir(parents=True, exist_ok=True)
    return train_models(args)


def _plan(args: argparse.Namespace) -> tuple[TrainingPlan, Path | None]:
    torch.set_num_threads(args.jobs)
    return (TrainingPlan.quick() if args.quick else TrainingPlan()), args.real


def train_models(args: argparse.Namespace) -> int:
    """Train the models, export and evaluate them."""
    plan, real = _plan(args)
    start = time.monotonic()
    train(plan, args.out, args.cache, real, args.jobs, args.recordings)
    print(
        f"trained in {(time.monotonic() - start) / 60:.1f} minutes (finished steps are taken from {args.cache})",
        flush=True,
    )
    for name in LADDER:
        path = args.out / f"{name}.onnx"
        if open_file(path).embeds:
            teach(path, args.cache, own.QUICK_PEOPLE if args.quick else own.PEOPLE, args.jobs)
    args.models, args.document, args.curve = args.out, None, False
    return evaluate_models(args)


def evaluate_models(args: argparse.Namespace) -> int:
    """Print the figures, and keep them in the manifest and the cards."""
    plan, real = _plan(args)
    paths = {name: args.models / f"{name}.onnx" for name in LADDER}
    for path in paths.values():
        open_model(path)  # says what is wrong before anything is simulated
    data = load_data(plan, args.cache, real, args.jobs, args.recordings)
    print(Evaluation.HEAD, flush=True)
    figures: dict[str, dict[str, Any]] = {
        name: {"simulated": found} for name, found in simulated_figures(paths, data).items()
    }
    if args.curve:
        for name, path in paths.items():
            print_curve(name, path, data)
    trained = learn(plan, data, args.cache)
    calibrated = calibration_set(trained, data, plan)
    for name, found in real_figures(trained, calibrated, data).items():
        figures[name]["real"] = found
    _keep(figures, plan, args)
    return 0


def _keep(figures: dict[str, dict[str, Any]], plan: TrainingPlan, args: argparse.Namespace) -> None:
    """Write the figures into the manifest, the cards and a document, and print them where they are wanted as JSON."""
    write_manifest(args.models, figures)
    write_cards(args.models, figures, plan)
    if args.document:
        write_block(args.document, args.models, figures)
    if args.json:
        print(json.dumps(figures, indent=2))
