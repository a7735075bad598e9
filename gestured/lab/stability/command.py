"""`gestured-lab stability`: prints the tables."""

import argparse
import json
import os
import platform
from collections.abc import Iterator
from dataclasses import asdict
from datetime import date

import numpy as np

from gestured.lab.dataset import cuts
from gestured.lab.made_of import made_of
from gestured.lab.samples import WINDOW
from gestured.lab.stability.decisions import decisions_table
from gestured.lab.stability.extremes import whole_path_table
from gestured.lab.stability.path import simulated_series
from gestured.lab.stability.relaxation import filters_table
from gestured.lab.table import Table
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER, shipped


def all_tables(quick: bool) -> Iterator[Table]:
    """One after the other, as they are done."""
    yield filters_table(quick)
    yield whole_path_table(open_model(LADDER[0]), quick)
    streams = [stream for _, stream in simulated_series(10 if quick else 60)]
    windows = [WINDOW.apply(segment) for stream in streams for segment in cuts(stream.frames, stream.times)]
    yield decisions_table(LADDER, windows, quick)


def run(args: argparse.Namespace) -> int:
    """Run `gestured-lab stability`."""
    where = f"{date.today()}, {platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    where += f", numpy {np.__version__}"
    if not args.json:
        print(f"{where}\n{made_of('gestured-lab stability', shipped().values())}\n")
    done = []
    for table in all_tables(args.quick):
        done.append(asdict(table))
        if not args.json:
            print(table, flush=True)
    if args.json:
        print(json.dumps({"measured": where, "tables": done}, indent=2))
    return 0
