"""The programs that are installed, as their parsers describe them. argparse has no public way to ask."""

import argparse

from gestured.bridge.cli import parser as bridge
from gestured.control.cli import parser as gesturectl
from gestured.daemon.cli import parser as gestured

PARSERS = {"gestured": gestured, "gesturectl": gesturectl, "gestured-bridge": bridge}


def arguments(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Flags and positional arguments that its help shows."""
    actions = [action for action in parser._actions if not isinstance(action, argparse._SubParsersAction)]
    return [action for action in actions if action.help != argparse.SUPPRESS]


def commands(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    """The parsers of its subcommands."""
    found = [action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return [command for choices in found for command in choices.values()]
