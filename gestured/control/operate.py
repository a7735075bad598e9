"""`gesturectl reload`, `recalibrate`, `emit`, `inhibit`, `allow`, `gestures`, `forget`: one request to the daemon."""

import argparse
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from gestured.client.program import Commands, Parser
from gestured.client.say import tell
from gestured.client.values import number, sensor_name
from gestured.control.address import add_sockets, connect
from gestured.control.status import own_faults


def add(commands: Commands) -> None:
    """Add the subcommands to gesturectl's command line."""
    parser = commands.add_parser(
        "reload",
        help="read model and configuration again",
        description="Have the daemon read its configuration and its model again. Both are checked, the model\n"
        "with its self-test, before anything changes; where something is wrong, the old ones stay\n"
        "and the exit status is 1. Settings that only a restart can change are named.",
        epilog="example:\n  gesturectl reload",
    )
    _asks(parser, "reload")
    parser = commands.add_parser(
        "recalibrate",
        help="learn the idle sensor anew",
        description="Have the daemon forget what it knows of the untouched sensor, and learn it from the next\n"
        "second without movement. Refused while the sensor is touched: a hand is no baseline.",
        epilog="example:\n  gesturectl recalibrate --sensor armrest",
    )
    parser.takes("--sensor", "NAME", "only this sensor (default: all)", type=sensor_name)
    _asks(parser, "recalibrate", "sensor")
    parser = commands.add_parser(
        "emit",
        help="publish a marked test event",
        description="Publish a gesture that nobody made, through every output of the daemon, so that you can try\n"
        'the other side without a sensor. Lines on the event socket carry "test":true; over OSC the\n'
        "gesture stands in a bundle behind /gestured/test.",
        epilog="example:\n  gesturectl emit swipe_left --sensor armrest",
    )
    parser.takes("gesture", "GESTURE", "one of the gestures in use")
    parser.takes("--sensor", "NAME", "the sensor named in the event (default: test)", type=sensor_name)
    _asks(parser, "emit", "gesture", "sensor")
    _add_gates(commands)
    parser = commands.add_parser(
        "gestures",
        help="list the gestures, and your own",
        description="List the model's gestures that are in use, and your own with how many examples each has.",
        epilog="example:\n  gesturectl gestures",
    )
    _asks(parser, "gestures")
    parser = commands.add_parser(
        "forget",
        help="forget a gesture of your own",
        description="Have the daemon recognise a gesture of your own no longer. Nothing of its examples stays in the\n"
        "daemon's files; a recording that somebody made keeps what it holds.",
        epilog="example:\n  gesturectl forget knock",
    )
    parser.takes("name", "NAME", "the gesture's name")
    _asks(parser, "forget", "name")


def _add_gates(commands: Commands) -> None:
    inhibit = commands.add_parser(
        "inhibit",
        help="close a gate, so that a sensor is silent",
        description="Close a gate of a sensor, or of all. While any of its gates is closed, every contact on the\n"
        "sensor is unknown. A gate stays closed until somebody allows it, across reloads too, unless --for\n"
        "says how long. Closing it again, also with --all, replaces the time that an earlier --for set.",
        epilog="examples:\n  gesturectl inhibit --all --gate door\n"
        "  gesturectl inhibit armrest --gate cleaning --for 600",
    )
    allow = commands.add_parser(
        "allow",
        help="open a gate",
        description="Open a gate of a sensor, or of all. The sensor listens again once all its gates are open.",
        epilog="examples:\n  gesturectl allow --all --gate door\n  gesturectl allow armrest --gate cleaning",
    )
    for parser in (inhibit, allow):
        which = parser.add_mutually_exclusive_group(required=True)
        which.add_argument("sensor", nargs="?", type=sensor_name, metavar="SENSOR", help="one sensor")
        which.add_argument("--all", action="store_true", help="all sensors, and all that come")
        parser.takes("--gate", "NAME", "the gate, by a name of your choice", type=sensor_name, required=True)
    text = "seconds after which the gate opens by itself (default: it does not)"
    inhibit.takes("--for", "S", text, dest="seconds", type=number(0.001, 1e9))
    _asks(inhibit, "inhibit", "gate", "sensor", "seconds")
    _asks(allow, "allow", "gate", "sensor")


def _asks(parser: Parser, verb: str, *parameters: str) -> None:
    """Let a subcommand ask the daemon the `verb`, with those of its arguments that `parameters` names."""
    add_sockets(parser)
    parser.runs(partial(_ask, verb, parameters), "print the daemon's answer")


def _ask(verb: str, parameters: tuple[str, ...], args: argparse.Namespace) -> int:
    with connect(args) as control:
        answer = control.ask(verb, **{name: getattr(args, name) for name in parameters})
        with control.reading():
            words = list(WORDS[verb](answer))
    tell(args.json, answer, *words)
    return 0


def _reloaded(answer: dict[str, Any]) -> Iterable[str]:
    waiting = ", ".join(answer.get("awaiting_restart", ()))  # an older daemon does not tell
    rest = f"; not yet in use, since only a restart changes it: {waiting}" if waiting else ""
    yield f"reloaded; {answer['model']} answers{rest}"
    yield from (f"a fallback cannot be used: {reason}" for reason in answer.get("refused", ()))


def _gates(answer: dict[str, Any]) -> Iterable[str]:
    silent = [f"{name} ({', '.join(gates)})" for name, gates in answer["sensors"].items() if gates]
    listen = [name for name, gates in answer["sensors"].items() if not gates]
    parts = [f"{word}: {', '.join(names)}" for word, names in (("silent", silent), ("no gate closed", listen)) if names]
    yield "; ".join(parts) or f"{answer['gate']}: noted for the sensors that come"


def _known(answer: dict[str, Any]) -> Iterable[str]:
    """The model's gestures, the user's own, and the faults of the user's own."""
    own = answer["own"]
    yield from (f"{name:<32} {answer['model']}" for name in answer["gestures"])
    yield from (f"{name:<32} your own, {count} examples" for name, count in own["gestures"].items())
    if not own["gestures"]:
        yield "none of your own"
    yield from (f"  {said}" for said in own_faults(answer))


# By verb: the daemon's answer in lines for a person.
WORDS: dict[str, Callable[[dict[str, Any]], Iterable[str]]] = {
    "reload": _reloaded,
    "recalibrate": lambda answer: [f"learning {', '.join(answer['sensors'])} anew; do not touch for a second"],
    "emit": lambda answer: ["published {gesture} of {sensor} as #{sequence}, marked as a test".format(**answer)],
    "inhibit": _gates,
    "allow": _gates,
    "gestures": _known,
    "forget": lambda answer: [f"forgot {answer['forgotten']}"],
}
