"""Data and networks of `gestured-lab train`, from its cache, for experiments with trained networks."""

import argparse
from dataclasses import replace
from pathlib import Path

import torch

from gestured.lab.cli import CACHE, MODELS
from gestured.lab.train import Trained, TrainingData, TrainingPlan, learn, load_data


def options(text: str | None) -> argparse.ArgumentParser:
    """A parser with the options that say which training is meant."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", type=Path, default=MODELS, help="folder of the models (%(default)s)")
    parser.add_argument("--cache", type=Path, default=CACHE, help="where finished steps are kept (%(default)s)")
    parser.add_argument("--real", type=Path, metavar="FOLDER", help="of real recordings, as docs/training.md has it")
    parser.add_argument("--recordings", type=Path, nargs="+", default=[], metavar="FILE", help="that taught them, too")
    parser.add_argument("--jobs", type=int, default=2, help="processes and threads (%(default)s)")
    parser.add_argument("--quick", action="store_true", help="a small run to try it")
    return parser


def loaded(args: argparse.Namespace, **less: int) -> tuple[TrainingPlan, TrainingData]:
    """The plan and its data; `less` overrides numbers that a program does not need, such as `days_points=1`."""
    torch.set_num_threads(args.jobs)
    plan = replace(TrainingPlan.quick() if args.quick else TrainingPlan(), **less)
    args.cache.mkdir(parents=True, exist_ok=True)
    return plan, load_data(plan, args.cache, args.real, args.jobs, args.recordings)


def trained(args: argparse.Namespace) -> tuple[TrainingPlan, TrainingData, Trained]:
    """The plan, its data and its networks."""
    plan, data = loaded(args)
    return plan, data, learn(plan, data, args.cache)
