"""`gesturectl check`: whether a model file can be used."""

import argparse
import sys

from gestured.client.program import Commands
from gestured.client.say import say, say_json
from gestured.core.errors import ModelError
from gestured.model.opening import check

UNUSABLE = 3


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "check",
        help="verify a model file",
        description="Open a model as the daemon would: its metadata, shapes and self-test.\n"
        "Exit status 3 if it cannot be used.",
        epilog="examples:\n  gesturectl check cnn_lstm\n  gesturectl check --json my_model.onnx",
    )
    parser.takes("model", "MODEL", "a path, or the name of a shipped model")
    parser.runs(run, "print what is known about it as JSON")


def run(args: argparse.Namespace) -> int:
    """Print what is known of the model. If it cannot be used, print the reason and return 3."""
    try:
        report = check(args.model)
    except ModelError as error:
        say(f"gesturectl: {error}", to=sys.stderr)
        return UNUSABLE
    if args.json:
        say_json(report)
        return 0
    for key, value in report.items():
        say(f"{key:<14} {_words(value)}")
    if not (report["digest"] or report["shipped"]):
        say("no digest: whether it is damaged cannot be told; gestured-lab writes one into each file that it exports")
    say("usable")
    return 0


def _words(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_words(inner)}" for key, inner in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_words, value))
    return f"{value:.3g}" if isinstance(value, float) else str(value)
