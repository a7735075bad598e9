"""The result of an experiment: printed, and written into a page with the command, models and code that made it."""

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from gestured.lab.made_of import DECIDES, command_of, made_of, renew
from gestured.lab.table import Table


def add_document(parser: argparse.ArgumentParser, block: str) -> None:
    """Add the option `--document`."""
    parser.add_argument("--document", type=Path, metavar="PAGE", help=f"a page whose block `{block}` is written anew")


def command() -> str:
    """The command that runs now, `python -m experiments.NAME ...`, as a page names it."""
    spec = sys.modules["__main__"].__spec__
    return command_of(["python", "-m", spec.name if spec else "experiments", *sys.argv[1:]])


def tell(
    found: Table | str, files: Iterable[Path], block: str, document: Path | None, code: Sequence[str] = DECIDES
) -> None:
    """Print a result and, if there is a document, write it into the document's block of that name.

    `files` and `code` are the models and the modules of gestured on which the result depends.
    """
    print(found)
    if document:
        renew(document, block, [made_of(command(), files, code), "", str(found)])
