"""`gestured-lab stability`: prints the tables, and writes them into a page."""

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict

from gestured.lab.made_of import made_of, renew, require_marks
from gestured.lab.stability.decisions import decisions_table
from gestured.lab.stability.extremes import whole_path_table
from gestured.lab.stability.filters import filters_table
from gestured.lab.stability.stiff import day_table, stiff_table
from gestured.lab.table import Table
from gestured.lab.written import printed
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER, shipped

TABLES: Mapping[str, Callable[[bool], Table]] = {  # by their marks in a page; the argument is whether to be quick
    "filters": filters_table,
    "extremes": lambda quick: whole_path_table(open_model(LADDER[0]), quick),
    "stiff": lambda quick: stiff_table(open_model(LADDER[0]), quick),
    "day": day_table,
    "models": lambda quick: decisions_table(LADDER, quick),
}

# Tables without models, and the modules that they measure.
WITHOUT_MODELS = {"filters": ("gestured.lab.stability.filters",), "day": ("gestured.core.front_end",)}


def run(args: argparse.Namespace) -> int:
    """Run `gestured-lab stability`."""
    for name in TABLES:
        require_marks(name, args.document)
    done = []
    for name, make in TABLES.items():
        table = make(args.quick)
        done.append(asdict(table))
        if not args.json:
            printed(str(table))
        if args.document:
            code = WITHOUT_MODELS.get(name)
            made = made_of(args.words, [], code) if code else made_of(args.words, shipped().values())
            renew(args.document, name, [made, "", str(table)])
    if args.json:
        printed(json.dumps(done, indent=2))
    return 0
