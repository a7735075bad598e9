"""`gesturectl reload`: another model or other settings, without losing a gesture."""

import argparse

from gestured.client.say import tell
from gestured.control.address import add_sockets, connect


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "reload",
        help="read model and configuration again",
        description="Have the daemon read its configuration and its model again. Both are checked, the model\n"
        "with its self-test, before anything changes; where something is wrong, the old ones stay\n"
        "and the exit status is 1.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example:\n  gesturectl reload",
    )
    add_sockets(parser)
    parser.add_argument("--json", action="store_true", help="print the daemon's answer")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Ask for it, and say which model answers now."""
    with connect(args) as control:
        answer = control.ask("reload")
    tell(args.json, answer, f"reloaded; {answer['model']} answers")
    return 0
