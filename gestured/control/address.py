"""Where the daemon is: the rules for its sockets."""

import argparse
import os
import signal
from collections.abc import Mapping
from pathlib import Path

from gestured.client.control import Control

SYSTEM = Path("/run/gestured/events.sock")  # of the installed service


def default_socket(environ: Mapping[str, str]) -> Path:
    """Where a daemon with the same environment keeps its event socket; the installed service's where none is there."""
    if path := environ.get("GESTURED_SOCKET"):
        return Path(path)
    if directory := environ.get("RUNTIME_DIRECTORY"):
        return Path(directory.split(":")[0]) / "events.sock"
    session = environ.get("XDG_RUNTIME_DIR")
    own = (Path(session, "gestured") if session else Path(f"/tmp/gestured-{os.getuid()}")) / "events.sock"
    return SYSTEM if SYSTEM.parent.is_dir() and not own.exists() else own


def default_control(environ: Mapping[str, str]) -> Path:
    """Where it keeps its control socket: beside the other."""
    if path := environ.get("GESTURED_CONTROL"):
        return Path(path)
    return default_socket(environ).with_suffix(".ctl")


def add_control(parser: argparse.ArgumentParser) -> None:
    """Add `--control` to a subcommand."""
    text = "the daemon's control socket (default: the daemon's own default)"
    parser.add_argument("--control", type=Path, metavar="PATH", help=text)


def finish_on_signals(control: Control) -> None:
    """From now on Ctrl-C and SIGTERM let `control.lines()` end, after what the daemon has said by then."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: control.finish())


def connect(args: argparse.Namespace) -> Control:
    """The daemon that `--control` names. Raises Unreachable."""
    return Control(args.control or default_control(os.environ))
