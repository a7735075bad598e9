"""The command line of gesturectl."""

import io
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from gestured.client import program

# Which function of which module adds which subcommands: only the module of the one that runs is imported.
SUBCOMMANDS = (
    ("status", "add", ("status",)),
    ("listen", "add", ("listen",)),
    ("view", "add", ("view",)),
    ("pad", "add", ("pad",)),
    ("doctor", "add", ("doctor",)),
    ("sniff", "add", ("sniff",)),
    ("operate", "add_reload", ("reload",)),
    ("operate", "add_recalibrate", ("recalibrate",)),
    ("operate", "add_emit", ("emit",)),
    ("gates", "add", ("inhibit", "allow")),
    ("own", "add", ("enrol", "gestures", "forget")),
    ("record", "add", ("record",)),
    ("flag", "add", ("flag",)),
    ("replay", "add", ("replay",)),
    ("export", "add", ("export",)),
    ("tune", "add", ("tune",)),
    ("simulate", "add", ("simulate",)),
    ("check", "add", ("check",)),
    ("demo", "add", ("demo",)),
)


def parser(argv: Sequence[str] = ()) -> program.Parser:
    """The command line, as far as these arguments need it; each subcommand adds itself and sets `run`."""
    top, commands = program.program(
        "gesturectl",
        "COMMAND",
        description="The operator's client of gestured.",
        epilog="example: gesturectl listen --gesture swipe_left",
    )
    asked = [row for row in SUBCOMMANDS if argv and argv[0] in row[2]]
    for module, add, _ in asked or SUBCOMMANDS:
        getattr(import_module(f"gestured.control.{module}"), add)(commands)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand; returns the exit status (0 as asked, 1 failed, 2 usage, 3 unusable model)."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without block characters shows question marks
    try:
        given = sys.argv[1:] if argv is None else argv
        status = program.run(parser(given), given)
        sys.stdout.flush()
        return status
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
