"""`gesturectl emit`: a made-up gesture through every output."""

import argparse

from gestured.client.say import tell
from gestured.control.address import add_sockets, connect


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "emit",
        help="publish a marked test event",
        description="Publish a gesture that nobody made, through every output of the daemon, so that you can try\n"
        'the other side without a sensor. Lines on the event socket carry "test":true; over OSC the\n'
        "gesture stands in a bundle behind /gestured/test.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example:\n  gesturectl emit swipe_left --sensor armrest",
    )
    parser.add_argument("gesture", metavar="GESTURE", help="one of the gestures in use")
    parser.add_argument("--sensor", metavar="NAME", help="whose event it is to be (default: test)")
    add_sockets(parser)
    parser.add_argument("--json", action="store_true", help="print the daemon's answer")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Ask for it, and say under which number it went out."""
    with connect(args) as control:
        answer = control.ask("emit", gesture=args.gesture, sensor=args.sensor)
    words = f"published {answer['gesture']} of {answer['sensor']} as #{answer['sequence']}, marked as a test"
    tell(args.json, answer, words)
    return 0
