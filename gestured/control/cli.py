"""The command line of gesturectl."""

import io
import os
import sys
from collections.abc import Sequence

from gestured.client import program
from gestured.control import (
    check,
    demo,
    doctor,
    export,
    flag,
    listen,
    names,
    operate,
    own,
    record,
    replay,
    shadow,
    simulate,
    sniff,
    status,
    tune,
    view,
    watch,
)

SUBCOMMANDS = (
    *(status.add, listen.add, view.add, watch.add, doctor.add, sniff.add),
    *(operate.add_reload, operate.add_recalibrate, shadow.add, operate.add_emit),
    own.add,
    *(record.add, flag.add, replay.add, export.add, tune.add),
    *(simulate.add, check.add, names.add, demo.add),
)


def parser() -> program.Parser:
    """The whole command line; each subcommand adds itself and sets `run`."""
    top, commands = program.program(
        "gesturectl",
        "COMMAND",
        description="The operator's client of gestured.",
        epilog="example: gesturectl listen --socket /run/gestured/events.sock",
    )
    for add in SUBCOMMANDS:
        add(commands)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand; returns the exit status (0 as asked, 1 failed, 2 usage, 3 unusable model)."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without block characters shows question marks
    try:
        status = program.run(parser(), argv)
        sys.stdout.flush()
        return status
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
