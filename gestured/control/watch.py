"""`gesturectl watch`: a sensor at a terminal, and the finger on it as it moves."""

import argparse
import queue
import sys
import threading
import time
from typing import Any

from gestured.client.subscriber import Subscriber
from gestured.control.address import add_sockets, connect
from gestured.control.screen import Felt, Screen, in_colour
from gestured.core.errors import GesturedError

LOOK_S = 0.05
ANSWERS = ("gesture", "unknown", "cancelled")


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "watch",
        help="a sensor at the terminal, the finger as it moves",
        description="Draw a sensor of the running daemon as it is felt, with the direction of the finger,\n"
        "phase, activity and answers, until Ctrl-C. 80 x 24 characters are enough.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example:\n  gesturectl watch armrest",
    )
    parser.add_argument("sensor", metavar="SENSOR", help="its name; gesturectl status lists them")
    add_sockets(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw until Ctrl-C."""
    if not sys.stdout.isatty():
        raise GesturedError("watch draws at a terminal; gesturectl listen prints events, gesturectl view has a page")
    with connect(args) as control:
        view = control.ask("view", sensor=args.sensor)
        felt, heard = Felt(in_colour()), hear(control.ask("status")["addresses"]["socket"], args.sensor)
        with Screen() as screen:
            while True:
                while not heard.empty():
                    felt.said.append(heard.get())
                screen.draw(felt.lines(view))
                time.sleep(LOOK_S)
                view = control.ask("view", sensor=args.sensor)


def hear(path: str, sensor: str) -> "queue.SimpleQueue[str]":
    """A sensor's answers in words, as they come; a thread listens."""
    heard: queue.SimpleQueue[str] = queue.SimpleQueue()

    def listen() -> None:
        for event in Subscriber(path, types=ANSWERS, sensors=[sensor]):
            if event["type"] != "lost":
                heard.put(answer(event))

    threading.Thread(target=listen, daemon=True).start()
    return heard


def answer(event: dict[str, Any]) -> str:
    """An answer in a few words."""
    if event["type"] == "cancelled":
        return f"cancelled: {event['reason']}"
    name = event["gesture"] if event["type"] == "gesture" else f"unknown ({event.get('reason', 'not sure')})"
    return f"{name}  {event['confidence']:.2f}  {1000 * (event['decided'] - event['offset']):.0f} ms"
