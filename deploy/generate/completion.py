"""Completions for bash, zsh and fish, which shtab makes from the programs' parsers."""

import argparse

import shtab

from deploy.generate.programs import arguments, commands

PATHS = ("FILE", "PATH", "FOLDER", "MODEL", "RECORDING", "OUT", "DEVICE")  # words that mean a file or a folder


def completion(parser: argparse.ArgumentParser, shell: str) -> str:
    """The script that completes subcommands, flags, choices and files in "bash", "zsh" or "fish"."""
    for action in (action for part in (parser, *commands(parser)) for action in arguments(part)):
        if any(word in str(action.metavar or action.dest).upper() for word in PATHS):
            action.complete = shtab.FILE  # type: ignore[attr-defined]  # shtab looks for this attribute
    return str(shtab.complete(parser, shell))
