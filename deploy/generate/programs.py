"""The parsers of the installed programs, their arguments and subcommands, for which argparse has no public way."""

import argparse

from gestured.bridge.cli import parser as bridge
from gestured.control.cli import parser as gesturectl
from gestured.daemon.cli import parser as gestured

PARSERS = {"gestured": gestured, "gesturectl": gesturectl, "gestured-bridge": bridge}


def arguments(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """The flags and positional arguments that a parser's help shows."""
    actions = [action for action in parser._actions if not isinstance(action, argparse._SubParsersAction)]
    return [action for action in actions if action.help != argparse.SUPPRESS]


def commands(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    """The parsers of a parser's subcommands."""
    found = [action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return [command for choices in found for command in choices.values()]
