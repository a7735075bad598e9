"""The programs that are installed, as their parsers describe them."""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass

from gestured.bridge.cli import parser as bridge
from gestured.control.cli import parser as gesturectl
from gestured.daemon.cli import parser as gestured


@dataclass(frozen=True)
class Option:
    """One flag or positional argument."""

    flags: tuple[str, ...]  # empty for a positional argument
    metavar: str  # empty for a flag that takes no value
    choices: tuple[str, ...]
    help: str


@dataclass(frozen=True)
class Program:
    """A program or one of its subcommands."""

    name: str
    summary: str
    text: str
    examples: str
    options: tuple[Option, ...]
    commands: tuple["Program", ...] = ()


PARSERS = {"gestured": gestured, "gesturectl": gesturectl, "gestured-bridge": bridge}


def options(parser: argparse.ArgumentParser) -> Iterator[Option]:
    """Its arguments, but for the subcommands."""
    for action in parser._actions:  # argparse has no public way to ask
        if isinstance(action, argparse._SubParsersAction) or action.help == argparse.SUPPRESS:
            continue
        metavar = action.metavar if isinstance(action.metavar, str) else None
        takes = action.nargs != 0
        choices = tuple(map(str, action.choices or ()))
        word = metavar or (",".join(choices) if choices else action.dest.upper())
        text = (action.help or "") % {"default": action.default, "prog": parser.prog, "metavar": word}
        yield Option(tuple(action.option_strings), word if takes else "", choices, text)


def read(name: str, parser: argparse.ArgumentParser, summary: str) -> Program:
    """A parser as a program, with its subcommands."""
    commands: list[Program] = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            summaries = {entry.dest: entry.help or "" for entry in action._choices_actions}
            commands += [read(f"{name} {key}", sub, summaries.get(key, "")) for key, sub in action.choices.items()]
    return Program(
        name, summary, parser.description or summary, parser.epilog or "", tuple(options(parser)), tuple(commands)
    )


def all_programs() -> tuple[Program, ...]:
    """gestured, gesturectl and gestured-bridge."""
    return (
        read("gestured", gestured(), "tactile gesture recognition daemon"),
        read("gesturectl", gesturectl(), "operator's client of gestured"),
        read("gestured-bridge", bridge(), "gestured on other buses, and serial sensors"),
    )
