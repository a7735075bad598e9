"""`gesturectl forget`: a gesture of one's own no longer."""

import argparse

from gestured.client.say import tell
from gestured.control.address import add_sockets, connect


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "forget",
        help="forget a gesture of your own",
        description="Have the daemon recognise a gesture of your own no longer. Nothing of its examples stays in the\n"
        "daemon's files; a recording that somebody made keeps what it holds.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example:\n  gesturectl forget knock",
    )
    parser.add_argument("name", metavar="NAME", help="the gesture's name")
    add_sockets(parser)
    parser.add_argument("--json", action="store_true", help="print the daemon's answer")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Ask for it."""
    with connect(args) as control:
        answer = control.ask("forget", name=args.name)
    tell(args.json, answer, f"forgot {answer['forgotten']}")
    return 0
