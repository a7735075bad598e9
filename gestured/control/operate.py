"""`gesturectl reload`, `recalibrate` and `emit`: what the daemon is asked to do, once."""

import argparse
from collections.abc import Callable
from functools import partial
from typing import Any

from gestured.client.program import Commands, Parser
from gestured.client.say import tell
from gestured.control.address import add_sockets, connect

Words = Callable[[dict[str, Any]], str]  # an answer of the daemon's for a person


def add_reload(commands: Commands) -> None:
    """Add `reload`: the daemon takes another model or other settings, and loses no gesture."""
    parser = commands.add_parser(
        "reload",
        help="read model and configuration again",
        description="Have the daemon read its configuration and its model again. Both are checked, the model\n"
        "with its self-test, before anything changes; where something is wrong, the old ones stay\n"
        "and the exit status is 1. Settings that only a restart can change are named.",
        epilog="example:\n  gesturectl reload",
    )
    asks(parser, "reload", _reloaded)


def _reloaded(answer: dict[str, Any]) -> str:
    """What a reload has done, and what it could not."""
    waiting = ", ".join(answer.get("awaiting_restart", ()))  # a daemon of before does not say
    rest = f"; not yet in use, since only a restart changes it: {waiting}" if waiting else ""
    return f"reloaded; {answer['model']} answers{rest}"


def add_recalibrate(commands: Commands) -> None:
    """Add `recalibrate`: the daemon learns what a sensor shows that nobody touches."""
    parser = commands.add_parser(
        "recalibrate",
        help="learn the idle sensor anew",
        description="Have the daemon forget what it knows of the untouched sensor, and learn it from the next\n"
        "second without movement. Refused while the sensor is touched: a hand is no baseline.",
        epilog="example:\n  gesturectl recalibrate --sensor armrest",
    )
    parser.add_argument("--sensor", metavar="NAME", help="only this sensor (default: all)")
    asks(
        parser,
        "recalibrate",
        lambda answer: f"learning {', '.join(answer['sensors'])} anew; do not touch for a second",
        "sensor",
    )


def add_emit(commands: Commands) -> None:
    """Add `emit`: the daemon sends a made-up gesture through every output."""
    parser = commands.add_parser(
        "emit",
        help="publish a marked test event",
        description="Publish a gesture that nobody made, through every output of the daemon, so that you can try\n"
        'the other side without a sensor. Lines on the event socket carry "test":true; over OSC the\n'
        "gesture stands in a bundle behind /gestured/test.",
        epilog="example:\n  gesturectl emit swipe_left --sensor armrest",
    )
    parser.add_argument("gesture", metavar="GESTURE", help="one of the gestures in use")
    parser.add_argument("--sensor", metavar="NAME", help="the sensor named in the event (default: test)")
    asks(
        parser,
        "emit",
        lambda a: f"published {a['gesture']} of {a['sensor']} as #{a['sequence']}, marked as a test",
        "gesture",
        "sensor",
    )


def asks(parser: Parser, verb: str, words: Words, *parameters: str) -> None:
    """Have a subcommand ask the daemon `verb`, with the values of these of its arguments, and print the answer."""
    add_sockets(parser)
    parser.add_argument("--json", action="store_true", help="print the daemon's answer")
    parser.set_defaults(run=partial(_ask, verb, words, parameters))


def _ask(verb: str, words: Words, parameters: tuple[str, ...], args: argparse.Namespace) -> int:
    with connect(args) as control:
        answer = control.ask(verb, **{name: getattr(args, name) for name in parameters})
    tell(args.json, answer, words(answer))
    return 0
