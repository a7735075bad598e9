"""Completions for bash, zsh and fish: shtab makes them of the programs' parsers."""

import argparse
from collections.abc import Iterator

import shtab

PATHS = ("FILE", "PATH", "FOLDER", "MODEL", "RECORDING")  # words in a metavar that mean something on disk


def completion(parser: argparse.ArgumentParser, shell: str) -> str:
    """The script that completes subcommands, flags, choices and files in "bash", "zsh" or "fish"."""
    for action in _actions(parser):
        if any(word in str(action.metavar).upper() for word in PATHS):
            action.complete = shtab.FILE  # type: ignore[attr-defined]  # shtab looks for this attribute
    return str(shtab.complete(parser, shell))


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All arguments of a program and its subcommands; argparse has no public way to ask."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
        else:
            yield action
