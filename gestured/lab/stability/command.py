"""`gestured-lab stability`: prints the tables, and with `--out` the figure."""

import argparse
import json
import os
import platform
from collections.abc import Iterator
from datetime import date
from pathlib import Path

import numpy as np

from gestured.lab.dataset import cuts
from gestured.lab.made_of import made_of
from gestured.lab.stability.coarse import coarse_table
from gestured.lab.stability.denormals import denormals_table
from gestured.lab.stability.exactness import exactness_table, short_windows
from gestured.lab.stability.extremes import month_table, parts_table, whole_path_table
from gestured.lab.stability.figure import svg
from gestured.lab.stability.metamorphic import metamorphic_table
from gestured.lab.stability.models import models_table
from gestured.lab.stability.path import simulated_series
from gestured.lab.stability.precision import precision_table, state_table
from gestured.lab.stability.relaxation import filters_table
from gestured.lab.stability.seeds import seeds_table
from gestured.lab.stability.textbook import RANGES, points, textbook_table
from gestured.lab.stability.wavelet_features import wavelets_table
from gestured.lab.table import Table
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER, shipped


def all_tables(quick: bool, out: Path | None) -> Iterator[Table]:
    """One after the other, as they are done; `out` is the folder that gets stability.svg."""
    yield filters_table(quick)
    panels = {title: points(low, high, np.float64, quick) for title, (low, high) in RANGES.items()}
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "stability.svg").write_text(svg(panels))
    for title, found in panels.items():
        yield textbook_table(title, found, points(*RANGES[title], np.float32, quick))
    models = {name: open_model(name) for name in LADDER}
    best = models[LADDER[0]]
    yield parts_table(list(models.values()), quick)
    yield whole_path_table(best, quick)
    yield month_table(best, 0.1 if quick else 30.0)
    window = best.metadata.window
    some = simulated_series(10 if quick else 60)
    windows = [window.apply(segment) for _, stream in some for segment in cuts(stream.frames, stream.times)]
    yield exactness_table(quick)
    yield models_table(windows, quick)
    yield precision_table(windows)
    yield state_table(windows)
    yield denormals_table(windows)
    yield coarse_table(models, 10 if quick else 60)
    yield wavelets_table(windows, short_windows(quick))
    yield seeds_table(*((40, 1) if quick else (200, 8)))
    yield metamorphic_table(models, 10 if quick else 150)


def run(args: argparse.Namespace) -> int:
    """Run `gestured-lab stability`: print and draw its tables."""
    where = f"{date.today()}, {platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    where += f", numpy {np.__version__}"
    if not args.json:
        print(f"{where}\n{made_of('gestured-lab stability --out docs', shipped().values())}\n")
    done = []
    for table in all_tables(args.quick, args.out):
        done.append(table.plain())
        if not args.json:
            print(table, flush=True)
    if args.json:
        print(json.dumps({"measured": where, "tables": done}, indent=2))
    return 0
