"""`gesturectl gestures`: the model's gestures and one's own."""

import argparse

from gestured.client.say import say, say_json
from gestured.control.address import add_sockets, connect


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "gestures",
        help="list the gestures, and your own",
        description="List the model's gestures that are in use, and your own with how many examples each has.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example:\n  gesturectl gestures",
    )
    add_sockets(parser)
    parser.add_argument("--json", action="store_true", help="print the daemon's answer as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Ask for them, and print them."""
    with connect(args) as control:
        answer = control.ask("gestures")
    if args.json:
        say_json({key: value for key, value in answer.items() if key != "ok"})
        return 0
    own = answer["own"]
    say(*(f"{name:<32} {answer['model']}" for name in answer["gestures"]))
    say(*(f"{name:<32} your own, {count} examples" for name, count in own["gestures"].items()) or ["none of your own"])
    for sentence in (own["fault"], own["gestures"] and own["off"], *own["doubtful"]):
        if sentence:
            say(f"  {sentence}")
    return 0
