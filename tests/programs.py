"""The programs' command lines."""

import argparse

from gestured.bridge.cli import parser as bridge
from gestured.control.cli import parser as gesturectl
from gestured.daemon.cli import parser as gestured
from gestured.lab.cli import parser as lab  # imports no torch

PARSERS: dict[str, argparse.ArgumentParser] = {
    "gestured": gestured(),
    "gesturectl": gesturectl(),
    "gestured-bridge": bridge(),
    "gestured-lab": lab(),
}


def subcommands(program: str) -> dict[str, argparse.ArgumentParser]:
    """Name of a subcommand -> its command line; none where the program has none."""
    for action in PARSERS[program]._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}
