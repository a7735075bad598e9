"""The command line of gesturectl."""

import io
import sys
from collections.abc import Sequence
from functools import partial
from importlib import import_module

from gestured.client import program

# (module, the subcommands that it adds): only the module of the subcommand that runs is imported.
SUBCOMMANDS = (
    ("status", ("status",)),
    ("listen", ("listen",)),
    ("view", ("view",)),
    ("pad", ("pad",)),
    ("doctor", ("doctor",)),
    ("sniff", ("sniff",)),
    ("operate", ("reload", "recalibrate", "emit", "inhibit", "allow", "gestures", "forget")),
    ("enrol", ("enrol",)),
    ("record", ("record",)),
    ("flag", ("flag",)),
    ("replay", ("replay",)),
    ("export", ("export",)),
    ("tune", ("tune",)),
    ("simulate", ("simulate",)),
    ("check", ("check",)),
    ("demo", ("demo",)),
)
ENDLESS = {"listen", "view", "pad", "simulate", "demo"}  # Ctrl-C is how they end; what others do, it cuts short


def parser(argv: Sequence[str] = ()) -> program.Parser:
    """The parser of gesturectl, with the subcommand that `argv` names, or else all; each subcommand sets `run`."""
    top, commands = program.program(
        "gesturectl",
        "COMMAND",
        description="The operator's client of gestured.",
        epilog="example: gesturectl listen --gesture swipe_left",
    )
    asked = [row for row in SUBCOMMANDS if argv and argv[0] in row[1]]
    for module, _ in asked or SUBCOMMANDS:
        import_module(f"gestured.control.{module}").add(commands)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand; returns 0 (done), 1 (failed), 2 (wrong usage), 3 (unusable model) or 130 (cut short)."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without block characters shows question marks
    given = sys.argv[1:] if argv is None else argv
    endless = bool({*given[:1]} & ENDLESS) or "--watch" in given
    try:
        return program.run(partial(parser, given), given, 0 if endless else program.INTERRUPTED)
    except BrokenPipeError:  # the reader of the output, such as `head`, has ended
        return 0
