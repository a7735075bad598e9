"""The command line of gesturectl."""

import io
import sys
from collections.abc import Sequence
from functools import partial
from importlib import import_module

from gestured.client import program

# By module, the subcommands that it adds: only the module of the subcommand that runs is imported.
SUBCOMMANDS = {
    **{name: (name,) for name in ("status", "listen", "view", "pad", "doctor", "sniff")},
    "operate": ("reload", "recalibrate", "emit", "inhibit", "allow", "gestures", "forget"),
    **{name: (name,) for name in ("enrol", "record", "flag", "replay", "export", "tune", "simulate", "check", "demo")},
}
ENDLESS = {"listen", "view", "pad", "simulate", "demo"}  # these end by Ctrl-C; any other command is cut short by it


def parser(argv: Sequence[str] = ()) -> program.Parser:
    """The parser of gesturectl, with the subcommand that `argv` names, or else all; each subcommand sets `run`."""
    top, commands = program.program(
        "gesturectl",
        "COMMAND",
        description="The operator's client of gestured.",
        epilog="example: gesturectl listen --gesture swipe_left",
    )
    asked = [module for module, names in SUBCOMMANDS.items() if argv and argv[0] in names]
    for module in asked or SUBCOMMANDS:
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
