"""The command line of gesturectl: one file per subcommand."""

import argparse
import io
import os
import sys
from collections.abc import Sequence

import gestured
from gestured.client.lines import JOIN, Forbidden
from gestured.client.say import say
from gestured.control import (
    check,
    demo,
    doctor,
    emit,
    enrol,
    export,
    flag,
    forget,
    gestures,
    listen,
    names,
    recalibrate,
    record,
    reload,
    replay,
    shadow,
    simulate,
    sniff,
    status,
    tune,
    view,
    watch,
)
from gestured.core.errors import GesturedError

SUBCOMMANDS = (
    *(status, listen, view, watch, doctor, sniff),
    *(reload, recalibrate, shadow, emit),
    *(enrol, gestures, forget),
    *(record, flag, replay, export, tune),
    *(simulate, check, names, demo),
)


def parser() -> argparse.ArgumentParser:
    """The whole command line; each subcommand adds itself and sets `run`."""
    top = argparse.ArgumentParser(
        prog="gesturectl",
        description="The operator's client of gestured.",
        epilog="example: gesturectl listen --socket /run/gestured/events.sock",
    )
    top.add_argument("--version", action="version", version=f"gesturectl {gestured.__version__}")
    commands = top.add_subparsers(metavar="COMMAND", required=True)
    for module in SUBCOMMANDS:
        module.add(commands)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand; returns the exit status (0 as asked, 1 failed, 2 usage, 3 unusable model)."""
    args = parser().parse_args(argv)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without block characters shows question marks
    try:
        status: int = args.run(args)
        sys.stdout.flush()
        return status
    except GesturedError as error:
        remedy = f" ({JOIN})" if isinstance(error, Forbidden) else ""
        say(f"gesturectl: {error}{remedy}", to=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 0
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
