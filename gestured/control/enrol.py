"""`gesturectl enrol`: teach the daemon a gesture of the user's own."""

import argparse
from typing import Any

from gestured.client.lines import Unreachable
from gestured.client.program import Commands
from gestured.client.say import say, say_json
from gestured.client.values import number, sensor_name
from gestured.control.address import add_sockets, connect
from gestured.core.own import A_NAME, EXAMPLES, is_name

USUAL = 3


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "enrol",
        help="teach a gesture of your own",
        description="Teach the daemon a gesture of your own: perform it a few times on a sensor. Each example is\n"
        "judged at once; one that is not kept is done again. From then on it is recognised on every sensor,\n"
        "without a restart. Ctrl-C gives it up, and nothing has changed. What is performed meanwhile is still\n"
        "published as whatever it is taken for.",
        epilog="examples:\n  gesturectl enrol knock --sensor armrest\n"
        "  gesturectl enrol wave --sensor armrest --examples 5",
    )
    parser.takes("name", "NAME", "a-z first, then a-z, 0-9 and _; at most 32", type=_name)
    parser.takes("--sensor", "SENSOR", "where it is performed", type=sensor_name, required=True)
    text = f"how often, 1 to {EXAMPLES} (default: {USUAL})"
    parser.takes("--examples", "N", text, type=number(1, EXAMPLES, whole=True), default=USUAL)
    add_sockets(parser)
    parser.runs(run, "print one JSON object a line")


def run(args: argparse.Namespace) -> int:
    """Enrol the gesture, and print how each example was judged; returns 1 if it was given up."""
    try:
        with connect(args) as control:
            control.ask("enrol", name=args.name, sensor=args.sensor, examples=args.examples)
            if not args.json:
                say(f"perform {args.name} on {args.sensor} {args.examples} times, a second apart; Ctrl-C gives up")
            for line in control.lines():
                if args.json:
                    say_json(line)
                else:
                    say(_words(line, args))
                if "enrolled" in line or "given_up" in line:
                    return int("given_up" in line)
            raise Unreachable(f"the daemon on {control.path} closed the connection; nothing has changed")
    except KeyboardInterrupt:
        return 1


def _words(line: dict[str, Any], args: argparse.Namespace) -> str:
    if "enrolled" in line:
        return f"enrolled {line['enrolled']} with {line['examples']} examples; it is recognised from now on"
    if "given_up" in line:
        return f"given up: {line.get('reason')}; nothing has changed"
    if line.get("kept") is True:
        return f"{line.get('example')} of {args.examples}: kept"
    return f"{line.get('example')} of {args.examples}: not kept, {line.get('reason')}"


def _name(text: str) -> str:
    if not is_name(text):
        raise argparse.ArgumentTypeError(f"{text!r}: expected {A_NAME}")
    return text
