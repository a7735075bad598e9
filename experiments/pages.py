"""What an experiment found: printed, and written into a page with the command, the models and the code that made it."""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

from gestured.lab.made_of import command_of, made_of, renew
from gestured.lab.table import Table


def add_document(parser: argparse.ArgumentParser, block: str) -> None:
    """The option `--document`."""
    parser.add_argument("--document", type=Path, metavar="PAGE", help=f"a page whose block `{block}` is written anew")


def tell(found: Table | str, files: Iterable[Path], module: str, block: str, document: Path | None) -> None:
    """Print it; and where there is a document, put it between the marks of a block of that name."""
    print(found)
    if document:
        command = command_of(["python", "-m", f"experiments.{module}", *sys.argv[1:]])
        renew(document, block, [made_of(command, files), "", str(found)])
