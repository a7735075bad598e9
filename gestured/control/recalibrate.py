"""`gesturectl recalibrate`: learn the idle sensor anew."""

import argparse

from gestured.client.say import tell
from gestured.control.address import add_sockets, connect


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "recalibrate",
        help="learn the idle sensor anew",
        description="Have the daemon forget what it knows of the untouched sensor, and learn it from the next\n"
        "second without movement. Refused while the sensor is touched: a hand is no baseline.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example:\n  gesturectl recalibrate --sensor armrest",
    )
    parser.add_argument("--sensor", metavar="NAME", help="only this sensor (default: all)")
    add_sockets(parser)
    parser.add_argument("--json", action="store_true", help="print the daemon's answer")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Ask for it, and say for which sensors it was done."""
    with connect(args) as control:
        answer = control.ask("recalibrate", sensor=args.sensor)
    words = f"learning {', '.join(answer['sensors'])} anew; do not touch for a second"
    tell(args.json, answer, words)
    return 0
