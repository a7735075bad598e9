"""`gesturectl names`: names of gestures, types or sensors, one a line; what completions offer."""

import argparse
from contextlib import suppress
from typing import Any

from gestured.client.program import Commands
from gestured.client.say import say
from gestured.control.address import add_sockets, connect
from gestured.core.errors import GesturedError
from gestured.core.messages import EVENT_TYPES
from gestured.simulator import GESTURES


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "names",
        help="print names of gestures, types of events, or sensors, one a line",
        description="Print names, one a line, for completions and scripts: the running daemon's, where there is one.",
        epilog="example:\n  gesturectl names sensors",
    )
    parser.add_argument("what", choices=("gestures", "types", "sensors"), help="what to list")
    add_sockets(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print them; without a daemon there are no sensors, and the gestures are those of the shipped models."""
    names: list[str] = list(EVENT_TYPES)
    if args.what != "types":
        status: dict[str, Any] = {"model": {"gestures": GESTURES}, "sensors": {}}
        with suppress(GesturedError), connect(args) as control:
            status = control.ask("status")
        names = list(status["sensors"] if args.what == "sensors" else status["model"]["gestures"])
    if names:
        say(*names)
    return 0
