"""The command line of programs with subcommands: their help, and the sentence if a subcommand fails."""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any, TextIO, TypeAlias

import gestured
from gestured.client.lines import JOIN, Forbidden
from gestured.client.say import say
from gestured.client.stop import ctrl_c_ends
from gestured.core.errors import GesturedError

INTERRUPTED = 130  # the exit status after Ctrl-C, as in a shell


class Parser(argparse.ArgumentParser):
    """A command line, or that of a subcommand; descriptions and examples keep their line breaks."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"formatter_class": argparse.RawDescriptionHelpFormatter} | options)

    def takes(self, name: str, metavar: str, help: str, **options: Any) -> None:
        """Add an argument with a value, for which `metavar` stands: a flag such as `--seconds`, or one by its place."""
        self.add_argument(name, metavar=metavar, help=help, **options)

    def runs(self, run: Callable[[argparse.Namespace], int], json: str) -> None:
        """Let a subcommand run `run`, and take `--json`, which does what `json` says."""
        self.add_argument("--json", action="store_true", help=json)
        self.set_defaults(run=run)


# The object to which subcommands add themselves; argparse has no public name for its type.
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


def program(name: str, kind: str, description: str, epilog: str) -> tuple[Parser, Commands]:
    """The command line of a program, and the object to which its subcommands, each a `kind`, add themselves."""
    more = f"`{name} {kind} --help` explains one {kind.lower()}, with examples."
    parser = Parser(prog=name, description=description, epilog=f"{epilog}\n\n{more}")
    parser.add_argument("--version", action="version", version=f"{name} {gestured.__version__}")
    return parser, parser.add_subparsers(metavar=kind, required=True)


def run(parser: Callable[[], Parser], argv: Sequence[str] | None, stopped: int = INTERRUPTED) -> int:
    """Run the subcommand of `argv`. Returns its exit status, 1 with a sentence for a GesturedError.

    `parser` may import modules that take long. `stopped` is the status after Ctrl-C.
    """
    # A stream is None if it was closed when the process began.
    sys.stdout = sys.stdout or open(os.devnull, "w")
    sys.stderr = sys.stderr or open(os.devnull, "w")  # else `print` would write its sentences to standard output
    try:
        with ctrl_c_ends(stopped):  # an import would turn its exception into an error of its own
            made = parser()
            args = made.parse_args(argv)
        status: int = args.run(args)
    except GesturedError as error:
        remedy = f" ({JOIN})" if isinstance(error, Forbidden) else ""
        say(f"{made.prog}: {error}{remedy}", to=sys.stderr)
        return 1
    except (KeyboardInterrupt, Exception) as error:
        if not _by_ctrl_c(error):
            raise
        return stopped
    finally:
        for stream in (sys.stdout, sys.stderr):
            _give_up(stream)
    return status


def _by_ctrl_c(error: BaseException | None) -> bool:
    """Whether Ctrl-C raised this, or its cause: where it interrupts a lock's wait, that raises a RuntimeError."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error is not None


def _give_up(stream: TextIO) -> None:
    """Flush a stream, or drop what it holds: else Python tries again when it exits, and exits with status 120."""
    try:
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
