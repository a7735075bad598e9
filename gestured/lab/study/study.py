"""`gestured-lab study`, put together: data, hyperparameters, cells, and every section of study.json."""

import argparse
import json
import os
import platform
import re
import time
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import torch

import gestured
from gestured.client.say import say_drawn
from gestured.lab.digest import file_digest
from gestured.lab.made_of import made_of, renew, require_marks
from gestured.lab.study import cohort, tables
from gestured.lab.study.cells import Schedule
from gestured.lab.study.choices import choices, tune
from gestured.lab.study.material import Data
from gestured.lab.study.methods import METHODS
from gestured.lab.study.picture import write_picture
from gestured.lab.study.report import choice, write_report
from gestured.lab.study.run_time import measure, with_fields
from gestured.lab.study.sessions import online
from gestured.lab.study.tables import Plan
from gestured.lab.study.views import Values
from gestured.lab.written import write
from gestured.model.shipped import shipped
from gestured.simulator import GESTURES

PAPER_CITED = (
    "C. Fumelli, A. Dutta and M. Kaboli: Advancements in Tactile Hand Gesture Recognition for Enhanced Human-Machine "
    "Interaction"
)


def run(args: argparse.Namespace) -> int:
    """Run `gestured-lab study`."""
    torch.set_num_threads(1)
    require_marks("study", *(args.document or ())[:1])
    require_marks("choice", *(args.document or ())[1:])
    args.out.mkdir(parents=True, exist_ok=True)
    plan = Plan.small() if args.quick else Plan()
    schedule = Schedule(args.cache / "study", args.jobs, args.cluster)
    study = compute(plan, schedule, args.real, args.foreign)
    study["about"]["command"] = args.words
    write(args.out / "study.json", json.dumps(study))
    tables_path = write_report(study, args.out)
    if args.document:
        lines = tables_path.read_text("utf-8").splitlines()[1:]  # without the first line, which `made` replaces
        made = made_of(args.words, shipped().values())
        renew(args.document[0], "study", [made, "", *(line for line in lines if not line.startswith("!["))])
        write_picture(study, args.document[0].parent)
        for document in args.document[1:]:
            renew(document, "choice", [made, "", *choice(study)])
    say_drawn(json.dumps(study, indent=2) if args.json else f"{tables_path}: {study['machine']['minutes']} minutes")
    return 0


def compute(plan: Plan, schedule: Schedule, folder: Path | None, others: Path | None = None) -> dict[str, Any]:
    """Everything that study.json holds; `others` are recordings that judge and teach nothing."""
    start = time.monotonic()
    schedule.cache.mkdir(parents=True, exist_ok=True)
    real = cohort.real(folder, plan.real)  # first, so that a wrong file is reported before half an hour of work
    foreign = cohort.judges(others) if others else None
    people = cohort.load_cohort(schedule.cache, plan.trials(), schedule.jobs)
    sets = {"simulated": Data.of(people.samples)}
    if real:
        sets["real"] = Data.of(real[0])
    if foreign:
        sets["foreign"] = Data.of(people.samples, foreign[0])
    tuned = tune(plan, _others(plan, schedule), schedule)
    cells = tables.wanted(plan, sets)
    tasks = {cell: tables.tasks_of(cell, tuned, plan) for cell in cells}
    results = schedule.results([task for some in tasks.values() for task in some], sets, "cells")
    found = {cell: tables.pooled([results[task] for task in some]) for cell, some in tasks.items()}
    figures = {cell: tables.row(cell, result) for cell, result in found.items()}
    models = {name: file_digest(path) for name, path in shipped().items()}
    study: dict[str, Any] = {
        "about": {
            "version": gestured.__version__, "command": "", "seed": plan.seed, "seeds": plan.seeds, "quick": plan.quick,
            "paper": PAPER_CITED, "gestures": list(GESTURES), "models": models,
        },
        "machine": machine(),
        "data": {
            "simulated": {
                "name": f"gestured's simulator, cohort seed {cohort.SEED}",
                "participants": len({trial.participant for trial in people.trials()}),
                "performed": people.performed, "cut": len(people), "lost": people.lost,
            },
            "real": real[1] if real else None, "foreign": foreign[1] if foreign else None,
        },
        "methods": {method.id: _about(method.id, tuned) for method in METHODS.values()},
        "cells": list(figures.values()),
        "trials": tables.by_trial(found, people.trials()),
        "copies": tables.copies(found),
        "choices": [] if plan.quick else choices(plan, tuned, people, sets, schedule),
    }  # fmt: skip
    # Timing comes last and alone: nothing else of this program runs beside it.
    simulated_data = sets["simulated"]
    judges = cohort.load_cohort(schedule.cache, plan.trials_of(plan.new_people), schedule.jobs, cohort.NEW_SEED)
    key = [simulated_data.key, asdict(plan), tuned, judges.samples.digest(), list(models.values())]
    study["run_time"] = schedule.once(
        "run-time", measure.__module__, key, lambda: measure(plan, tuned, judges, simulated_data)
    )
    judged = (foreign[0], int(foreign[1]["performed"])) if foreign else None
    study["run_time"] = with_fields(study["run_time"], figures, judged)
    study["online"], study["online_shipped"] = played(plan, tuned, simulated_data, schedule)
    study["machine"]["minutes"] = round((time.monotonic() - start) / 60, 1)
    return study


def played(plan: Plan, tuned: dict[str, Values], data: Data, schedule: Schedule) -> list[list[dict[str, Any]]]:
    """The online protocol's rows: of the study's models, and of the shipped ones."""
    key = [data.key, asdict(plan), tuned, [file_digest(path) for path in shipped().values()]]
    made: list[list[dict[str, Any]]] = schedule.once(
        "online", online.__module__, key, lambda: online(plan, tuned, data)
    )
    return made


def _others(plan: Plan, schedule: Schedule) -> Data | None:
    """People on whom hyperparameters are compared; None in a quick study."""
    if not plan.tuning_people:
        return None
    trials = plan.trials_of(plan.tuning_people)
    return Data.of(cohort.load_cohort(schedule.cache, trials, schedule.jobs, cohort.TUNING_SEED).samples)


def _about(name: str, tuned: Mapping[str, Values]) -> dict[str, Any]:
    method = METHODS[name]
    given = {k: dict(v) for k, v in method.paper.items()} if method.paper else None
    return {
        "title": method.title, "paper": method.paper is not None,
        "hyperparameters": {"paper": given, "tuned": dict(tuned[name])},
    }  # fmt: skip


def machine() -> dict[str, object]:
    """Processor, cores, versions and today's date; `minutes` is filled in at the end."""
    info = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*: (.*)", info.read_text()) if info.exists() else None
    return {
        "cpu": model[1] if model else platform.processor() or platform.machine(), "cores": os.cpu_count(),
        "python": platform.python_version(), "date": time.strftime("%Y-%m-%d"), "minutes": 0.0,
        **{name: version(name) for name in ("numpy", "torch", "scikit-learn", "onnxruntime")},
    }  # fmt: skip
