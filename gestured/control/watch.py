"""`gesturectl watch`: a sensor at a terminal, and the finger on it as it moves."""

import argparse
import sys
from typing import Any

from gestured.client.lines import Unreachable
from gestured.client.program import Commands
from gestured.control.address import add_sockets, connect
from gestured.control.screen import Felt, Screen, in_colour
from gestured.core.errors import GesturedError

SHOWN = ("provisional", "gesture", "unknown", "cancelled")


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "watch",
        help="show a sensor at the terminal, live",
        description="Draw a sensor of the running daemon as it is felt, with the direction of the finger,\n"
        "phase, activity and answers, provisional ones too, until Ctrl-C. 80 x 24 characters are enough.",
        epilog="example:\n  gesturectl watch armrest",
    )
    parser.add_argument("sensor", metavar="SENSOR", help="its name; gesturectl status lists them")
    add_sockets(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw the sensor until Ctrl-C ends it."""
    if not sys.stdout.isatty():
        raise GesturedError("watch draws at a terminal; gesturectl listen prints events, gesturectl view has a page")
    with connect(args) as control:
        view = control.ask("view", sensor=args.sensor)  # who is not there is refused
        control.ask("follow", sensors=[args.sensor])
        felt = Felt(in_colour())
        with Screen() as screen:
            for line in control.lines():
                if line["type"] == "view":
                    view = line
                elif line["type"] == "state":  # a sensor that is silent has no views
                    view["state"] = line["sensors"].get(args.sensor, view)["state"]
                elif line["type"] in SHOWN and line["sensor"] == args.sensor:
                    felt.said.append(in_words(line))
                screen.draw(felt.lines(view))
        raise Unreachable(f"the daemon on {control.path} closed the connection")


def in_words(event: dict[str, Any]) -> str:
    """An answer, or what it will most probably be, in a few words."""
    if event["type"] == "cancelled":
        return f"cancelled: {event['reason']}"
    if event["type"] == "provisional":
        return f"probably {event['gesture']}  {event['confidence']:.2f}"
    name = event["gesture"] if event["type"] == "gesture" else f"unknown ({event.get('reason', 'not sure')})"
    return f"{name}  {event['confidence']:.2f}  {1000 * (event['decided'] - event['offset']):.0f} ms"
